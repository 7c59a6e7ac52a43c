// Headless Chromium for tests and scripts. Graphics are rendered in software (SwiftShader).

import {existsSync} from 'node:fs';

import {chromium} from 'playwright-core';

/** Path of Chromium or Chrome, or undefined. The environment variable CHROMIUM overrides it. */
export function findChromium() {
  return [process.env.CHROMIUM || '/usr/bin/chromium', '/usr/bin/chromium-browser',
    '/usr/bin/google-chrome'].find(existsSync);
}

export const switches = [
  '--headless', '--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader',
  '--enable-precise-memory-info', '--disable-quic', '--no-first-run',
  '--disable-background-networking',
  '--disable-component-update', '--disable-sync'];

export function launch() {
  const executablePath = findChromium();
  if (!executablePath) throw new Error('Chromium not found; on Debian: apt-get install chromium');
  return chromium.launch({executablePath, args: switches, timeout: 120_000});
}
