// Usage: node scripts/test.mjs [NAME...]. Runs test/NAME.test.ts. Without names it checks types and
// runs all tests.
import {execFileSync, spawnSync} from 'node:child_process';
import {readdirSync, rmSync} from 'node:fs';
import {createRequire} from 'node:module';
import {fileURLToPath} from 'node:url';
import {build} from 'esbuild';

const folder = fileURLToPath(new URL('..', import.meta.url));
const tsc = createRequire(import.meta.url).resolve('typescript/bin/tsc');
const names = process.argv.slice(2);
const all = names.length === 0;
const files = readdirSync(`${folder}/test`).filter((file) => file.endsWith('.test.ts')).sort()
                  .filter((file) => all || names.includes(file.replace('.test.ts', '')));
if (files.length === 0 || (!all && files.length !== names.length)) {
  console.error(`test: expected names of test/NAME.test.ts, got ${names.join(', ')}`);
  process.exit(2);
}

const out = `${folder}/build/test-${all ? 'all' : names.join('-')}`;
try {
  if (all) execFileSync(process.execPath, [tsc, '-p', folder], {stdio: 'inherit'});
} catch {
  process.exit(1);  // tsc has printed the errors.
}
rmSync(out, {recursive: true, force: true});
await build({
  entryPoints: files.map((file) => `${folder}/test/${file}`),
  outdir: out,
  bundle: true,
  loader: {'.wasm': 'binary'},
  packages: 'external',
  platform: 'node',
  format: 'esm',
  target: 'node18',
  outExtension: {'.js': '.mjs'},
  sourcemap: 'inline',
  define: {STRIDEWIRE_ROOT: JSON.stringify(fileURLToPath(new URL('../../..', import.meta.url)))},
});
const run = spawnSync(
    process.execPath,
    ['--enable-source-maps', '--expose-gc', '--test', ...files.map((file) =>
        `${out}/${file.replace(/\.ts$/, '.mjs')}`)],
    {stdio: 'inherit'});
process.exit(run.status ?? 1);
