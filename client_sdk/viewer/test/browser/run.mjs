// Runs browser tests. Usage: node test/browser/run.mjs [NAME...], where NAME stands for
// NAME.test.mjs; without names, all of them. The exit code is 77 if there is no Chromium.

import {spawnSync} from 'node:child_process';
import {readdirSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';

import {findChromium} from '../browser.mjs';

if (!findChromium()) {
  console.log('Skipped: Chromium not found. On Debian, install it with: apt-get install chromium');
  process.exit(77);
}
if (!process.env.STRIDEWIRE_BIN) {
  console.error('STRIDEWIRE_BIN must be set to the folder of stridewired and web_pose_dump');
  process.exit(2);
}
const here = dirname(fileURLToPath(import.meta.url));
const names = process.argv.slice(2);
const tests = names.length > 0 ? names.map((name) => `${name}.test.mjs`) :
  readdirSync(here).filter((name) => name.endsWith('.test.mjs')).sort();
// The tests run one after the other, each with its own server and browser.
for (const test of tests) {
  const {status} = spawnSync(process.execPath, ['--test', join(here, test)], {stdio: 'inherit'});
  if (status !== 0) process.exitCode = 1;
}
