// Type-checks the viewer, then bundles the unit tests with esbuild and runs them with node:test.

import {execFileSync} from 'node:child_process';
import {mkdtempSync, readdirSync, rmSync} from 'node:fs';
import {createRequire} from 'node:module';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';

import * as esbuild from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const run = (...command) =>
  execFileSync(process.execPath, command, {stdio: 'inherit', cwd: join(here, '..')});
const out = mkdtempSync(join(here, '../build-test-'));
try {
  run(createRequire(import.meta.url).resolve('typescript/bin/tsc'), '--noEmit');
  const tests = readdirSync(here).filter((name) => name.endsWith('_test.ts'));
  await esbuild.build({
    entryPoints: tests.map((name) => join(here, name)), bundle: true, platform: 'node',
    format: 'esm', outdir: out, outExtension: {'.js': '.mjs'}, logLevel: 'warning',
    sourcemap: 'inline'});
  run('--enable-source-maps', '--test', ...tests.map(
    (name) => join(out, name.replace('.ts', '.mjs'))));
} catch {
  process.exitCode = 1;  // The failed program has printed the reason.
} finally {
  rmSync(out, {recursive: true, force: true});
}
