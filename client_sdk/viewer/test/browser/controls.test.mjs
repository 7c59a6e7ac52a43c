// Tests that each control of the viewer page does what its label says, and each key what the help
// dialog says. The test fails if the page has a control or key without a check, or the reverse.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {Client} from '@stridewire/client';
import WebSocket from 'ws';

import {launch} from '../browser.mjs';
import {controlChecks, controlNames} from './control_checks.mjs';
import {openControlsPage} from './controls_page.mjs';
import {keyChecks} from './key_checks.mjs';
import {Server, logDuration, saveScreenshot} from './support.mjs';

let server;
let client;
let alpha;
let browser;

before(async () => {
  server = await Server.start();
  // A second client, which observes what the page does and creates a second world.
  client = new Client({url: `ws://127.0.0.1:${server.httpPort}/stream`, webSocket: WebSocket});
  client.connect();
  alpha = client.joinWorld('alpha');
  const beta = client.joinWorld('beta');
  assert.ok((await beta.spawn([{avatar: 1, positionM: [0, 0, 0], headingRad: 0}])).ok);
  browser = await launch();
});

after(async () => {
  await browser?.close();
  client?.close();
  await server?.kill();
});

async function run(page, name, check) {
  const began = performance.now();
  try {
    await check();
    logDuration(began, name);
  } catch (error) {
    error.message = `${name}: ${error.message}`;
    await saveScreenshot(page, 'failed_control');
    throw error;
  }
}

test('every control does what its label says, every key what the help says', async () => {
  const t = await openControlsPage(browser, server, client, alpha);
  const {page, context, errors} = t;
  const checks = controlChecks(t);
  const seen = new Set(await controlNames(page));
  for (const [name, check] of checks) {
    await run(page, name, check);
    for (const control of await controlNames(page)) seen.add(control);
  }
  assert.deepEqual([...seen].sort(), checks.map(([name]) => name).sort());

  await t.openPanel('Commands');
  const keys = keyChecks(t);
  const inHelp = await page.locator('dialog dt').allTextContents();
  assert.deepEqual(inHelp.sort(), Object.keys(keys).sort());
  for (const [name, check] of Object.entries(keys)) await run(page, `key ${name}`, check);
  console.log(`checked ${seen.size} controls and ${inHelp.length} keys and gestures`);
  assert.deepEqual(errors, []);
  await context.close();
});
