// Headless Chromium for the scripts here; graphics by SwiftShader, on the processor.

import {existsSync} from 'node:fs';

import {chromium} from 'playwright-core';

/** `CHROMIUM` names another one; undefined: there is none. */
export function findChromium() {
  return [process.env.CHROMIUM || '/usr/bin/chromium', '/usr/bin/chromium-browser',
    '/usr/bin/google-chrome'].find(existsSync);
}

export const switches = [
  '--headless', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
  '--enable-precise-memory-info', '--disable-quic', '--no-first-run', '--disable-background-networking',
  '--disable-component-update', '--disable-sync'];

export function launch() {
  const executablePath = findChromium();
  if (!executablePath) throw new Error('there is no Chromium; on Debian: apt-get install chromium');
  return chromium.launch({executablePath, args: switches, timeout: 120_000});
}
