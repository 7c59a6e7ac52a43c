// Messages from the schema: generated/. FLATC names another flatc.
import {execFileSync} from 'node:child_process';
import {existsSync, mkdirSync, rmSync, statSync} from 'node:fs';
import {fileURLToPath} from 'node:url';

const schema = fileURLToPath(new URL('../../../protocol/schema/stridewire.fbs', import.meta.url));
const out = fileURLToPath(new URL('../generated', import.meta.url));
const flatc = process.env.FLATC || 'flatc';
const main = `${out}/stridewire_generated.ts`;

if (!existsSync(main) || statSync(main).mtimeMs < statSync(schema).mtimeMs) {
  rmSync(out, {recursive: true, force: true});
  mkdirSync(out, {recursive: true});
  try {
    execFileSync(flatc, ['--ts', '-o', out, schema], {stdio: 'inherit'});
  } catch (error) {
    console.error(`generate: ${flatc} did not run (${error.message}); Debian has it as ` +
                  'flatbuffers-compiler, FLATC names another');
    process.exit(1);
  }
}
