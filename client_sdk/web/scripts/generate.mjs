// Generates generated/ from the protocol's schema. The environment variable FLATC overrides the
// path of flatc.
import {execFileSync} from 'node:child_process';
import {
  existsSync, mkdirSync, readFileSync, readdirSync, rmSync, statSync, writeFileSync
} from 'node:fs';
import {fileURLToPath} from 'node:url';
import {layoutModule, parseSchema} from './schema.mjs';

const path = (url) => fileURLToPath(new URL(url, import.meta.url));
const schema = path('../../../protocol/schema/stridewire.fbs');
const out = path('../generated');
const last = `${out}/layout.ts`;
const flatc = process.env.FLATC || 'flatc';

const newest = Math.max(
    ...[schema, path('generate.mjs'), path('schema.mjs')].map((file) => statSync(file).mtimeMs));
if (!existsSync(last) || statSync(last).mtimeMs < newest) {
  rmSync(out, {recursive: true, force: true});
  mkdirSync(out, {recursive: true});
  try {
    execFileSync(flatc, ['--ts', '-o', out, schema], {stdio: 'inherit'});
  } catch (error) {
    console.error(`generate: could not run ${flatc} (${error.message}). Install flatc (package ` +
                  'flatbuffers-compiler on Debian) or set FLATC to its path.');
    process.exit(1);
  }
  // The index that flatc 2.0.8 generates omits tables without references, which includes all
  // messages.
  const modules = readdirSync(`${out}/stridewire/wire`).sort();
  writeFileSync(`${out}/wire.ts`, modules.map((file) =>
      `export * from './stridewire/wire/${file.replace(/\.ts$/, '')}';\n`).join(''));
  writeFileSync(last, layoutModule(parseSchema(readFileSync(schema, 'utf8'))));
}
