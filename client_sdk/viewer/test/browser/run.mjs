// Runs NAME.test.mjs beside it for each NAME given, or all. 77: there is no browser to run them in.

import {spawnSync} from 'node:child_process';
import {readdirSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';

import {findChromium} from '../browser.mjs';

if (!findChromium()) {
  console.log('No Chromium: the viewer is not tested in a browser; on Debian: apt-get install chromium');
  process.exit(77);
}
if (!process.env.STRIDEWIRE_BIN) {
  console.error('STRIDEWIRE_BIN names no folder of built programs');
  process.exit(2);
}
const here = dirname(fileURLToPath(import.meta.url));
const names = process.argv.slice(2);
const tests = names.length > 0 ? names.map((name) => `${name}.test.mjs`) :
  readdirSync(here).filter((name) => name.endsWith('.test.mjs')).sort();
// One after the other: each has a server and a browser of its own.
for (const test of tests) {
  const {status} = spawnSync(process.execPath, ['--test', join(here, test)], {stdio: 'inherit'});
  if (status !== 0) process.exitCode = 1;
}
