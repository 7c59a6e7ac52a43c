// Builds dist/: the bundled module, with dependencies left external, and its type declarations.
import {execFileSync} from 'node:child_process';
import {mkdirSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const folder = fileURLToPath(new URL('..', import.meta.url));
const tsc = createRequire(import.meta.url).resolve('typescript/bin/tsc');

rmSync(`${folder}/dist`, {recursive: true, force: true});
rmSync(`${folder}/build/types`, {recursive: true, force: true});
try {
  execFileSync(process.execPath, [tsc, '-p', `${folder}/tsconfig.types.json`], {stdio: 'inherit'});
} catch {
  process.exit(1);  // tsc has printed the errors.
}

const copied = new Set();
/**
 * Copies the declarations of a module, for example `src/index`, and of the modules that it imports
 * to dist/types. Sources import modules without extension, but module resolution `nodenext`
 * requires one.
 */
function copyTypes(name) {
  if (copied.has(name)) return;
  copied.add(name);
  const text = readFileSync(`${folder}/build/types/${name}.d.ts`, 'utf8');
  mkdirSync(dirname(`${folder}/dist/types/${name}`), {recursive: true});
  writeFileSync(`${folder}/dist/types/${name}.d.ts`,
                text.replace(/(\bfrom |\bimport\()'(\.[\w./]+)'/g, (_, keyword, module) => {
                  copyTypes(join(dirname(name), module));
                  return `${keyword}'${module}.js'`;
                }));
}
copyTypes('src/index');
copyTypes('src/testing');

await build({
  entryPoints: [`${folder}/src/index.ts`],
  outfile: `${folder}/dist/index.js`,
  bundle: true,
  loader: {'.wasm': 'binary'},
  packages: 'external',
  format: 'esm',
  target: 'es2022',
  sourcemap: true,
});

// The tools for tests are in the same file as the client, because both share the WebAssembly
// module.
const tools = [...readFileSync(`${folder}/src/testing.ts`, 'utf8')
                   .matchAll(/^export function (\w+)/gm)].map((match) => match[1]);
writeFileSync(`${folder}/dist/testing.js`,
              `import {testing} from './index.js';\n\n` +
              `export const {${tools.join(', ')}} = testing;\n`);
