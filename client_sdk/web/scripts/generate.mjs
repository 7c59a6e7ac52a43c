// Generates generated/ from the protocol's schema and from the WebAssembly module. The environment
// variables FLATC and PYTHON override the paths of flatc and python3.
import {execFileSync} from 'node:child_process';
import {
  existsSync, mkdirSync, readdirSync, rmSync, statSync, writeFileSync
} from 'node:fs';
import {fileURLToPath} from 'node:url';
import {nativeModule, nativeSources} from './native.mjs';

const path = (url) => fileURLToPath(new URL(url, import.meta.url));
const schema = path('../../../protocol/schema/stridewire.fbs');
const generator = path('../../../protocol/generator');
const out = path('../generated');
const last = `${out}/codec.ts`;

function run(variable, program, debianPackage, args) {
  const command = process.env[variable] || program;
  try {
    execFileSync(command, args, {stdio: 'inherit'});
  } catch (error) {
    console.error(`generate: could not run ${command} (${error.message}). Install ${program} ` +
                  `(package ${debianPackage} on Debian) or set ${variable} to its path.`);
    process.exit(1);
  }
}

const sources = readdirSync(generator).filter((file) => file.endsWith('.py'))
                    .map((file) => `${generator}/${file}`);
const newest = Math.max(...[schema, path('generate.mjs'), ...nativeSources, ...sources]
                            .map((file) => statSync(file).mtimeMs));
if (!existsSync(last) || statSync(last).mtimeMs < newest) {
  rmSync(out, {recursive: true, force: true});
  mkdirSync(out, {recursive: true});
  const generate = (kind) =>
      run('PYTHON', 'python3', 'python3', [`${generator}/generate.py`, schema, kind, out]);
  generate('flatc');
  run('FLATC', 'flatc', 'flatbuffers-compiler', ['--ts', '-o', out, `${out}/stridewire.fbs`]);
  // The index that flatc 2.0.8 generates omits each table to which no other table refers, and
  // therefore all messages.
  const modules = readdirSync(`${out}/stridewire/wire`).sort();
  writeFileSync(`${out}/wire.ts`, modules.map((file) =>
      `export * from './stridewire/wire/${file.replace(/\.ts$/, '')}';\n`).join(''));
  writeFileSync(`${out}/native.ts`, nativeModule());
  generate('web');
}
