// The library page in a browser: its controls work, and it shows the steps of the server's library.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {launch} from '../browser.mjs';
import {Server, openInContext, saveScreenshot, sleep, waitFor} from './support.mjs';

let server;
let browser;
let context;
let page;
let errors;

before(async () => {
  server = await Server.start();
  browser = await launch();
  context = await browser.newContext({viewport: {width: 1280, height: 720}, colorScheme: 'light'});
  ({page, errors} = await openInContext(context,
    `http://127.0.0.1:${server.httpPort}/library.html`));
  await stepShown(0);
});

after(async () => {
  await browser?.close();
  await server?.kill();
});

const stepShown = (after) => waitFor('a new step is shown', () => page.evaluate(
  (count) => window.stridewireLibrary?.stepsShown > count, after));
const stepsShown = () => page.evaluate(() => window.stridewireLibrary.stepsShown);
const requested = () => page.evaluate(() => [...window.stridewireLibrary.requested]);
const settled = () => waitFor('the step for the requested parameters is shown', () =>
  page.evaluate(() => {
    const {step, requested} = window.stridewireLibrary;
    return step && step.requested.length === requested.length &&
      step.requested.every((v, l) => Math.abs(v - requested[l]) < 2e-5);
  }));
/** Position of parameters on the page. */
const positionOf = (p) => page.evaluate((values) => {
  const {plane} = window.stridewireLibrary;
  const box = plane.element.getBoundingClientRect();
  const at = plane.toPixels(values);
  return {x: box.left + at.x, y: box.top + at.y};
}, p);

test('says what the library can do and whether it passes its self-check', async () => {
  const area = page.locator('#summary');
  await waitFor('the summary has been received', async () =>
    (await area.locator('summary').textContent()).includes('Self-check'));
  await area.locator('summary').click();
  const text = await area.textContent();
  for (const part of ['Starts', 'Turns to the left', 'Jumps', 'Walk to a goal 3 m ahead']) {
    assert.ok(text.includes(part), part);
  }
  await area.locator('summary').click();
});

test('dragging the cross changes the step immediately', async () => {
  const before = await requested();
  const from = await positionOf(before);
  const stepsBefore = await stepsShown();
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  for (let i = 1; i <= 8; ++i) await page.mouse.move(from.x + 3 * i, from.y - 4 * i);
  await stepShown(stepsBefore);  // The button is still pressed.
  await page.mouse.up();
  await settled();
  const after = await requested();
  assert.ok(after[0] > before[0] + 0.02 && after[1] > before[1] + 0.02, `${before}, then ${after}`);
  const step = await page.evaluate(() => window.stridewireLibrary.step);
  // Correction is on, so the measured parameters equal the requested ones to 0.05 mm.
  step.measured.forEach((v, l) => assert.ok(Math.abs(v - after[l]) < 5e-5, `${step.measured}`));
  const last = step.roots_m.length - 1;
  assert.ok(step.roots_m[last] > 0.2, 'the step goes forward');
});

test('plays an example beside the step with its parameters, and both are equal', async () => {
  const sites = await page.evaluate(() => window.stridewireLibrary.group.sites);
  const index = 5;
  const at = await positionOf(sites[index].p);
  await page.mouse.click(at.x, at.y);
  await settled();
  await waitFor('the example has been received', () => page.evaluate(
    () => window.stridewireLibrary.preview.example !== null));
  assert.deepEqual((await requested()).map((v) => Math.round(1e5 * v)),
    sites[index].p.map((v) => Math.round(1e5 * v)));
  const {step, example} = await page.evaluate(() => {
    const {preview} = window.stridewireLibrary;
    return {step: preview.step, example: preview.example};
  });
  assert.equal(step.rotations.length, example.rotations.length);
  step.rotations.forEach((v, i) => assert.ok(Math.abs(v - example.rotations[i]) < 1e-3));
  // Both are drawn, 1.1 m apart.
  await waitFor('two avatars are drawn', () => page.evaluate(
    () => window.stridewireLibrary.preview.pose.count === 2));
  const roots = await page.evaluate(() => [...window.stridewireLibrary.preview.pose.rootsM]);
  assert.ok(Math.abs(roots[0] - roots[3] - 1.1) < 0.02, `${roots}`);
  assert.ok(Math.abs(roots[2] - roots[5]) < 0.02, `${roots}`);
  await saveScreenshot(page, 'library');
});

test('the error map has small errors at examples, and can be switched', async () => {
  const largest = () => page.evaluate(() => {
    const {plane} = window.stridewireLibrary;
    return plane.map === null ? null : plane.map.largest_m;
  });
  const uncorrected = await waitFor('the error map is shown', largest);
  await page.selectOption('#map', 'corrected');
  await waitFor('the corrected map is shown', async () => await largest() < uncorrected / 5);
  await page.selectOption('#map', 'none');
  assert.equal(await largest(), null);
  await page.selectOption('#map', 'uncorrected');
  await waitFor('the first map is shown again', async () => await largest() === uncorrected);
  const atExample = await page.evaluate(() => {
    const {plane, group} = window.stridewireLibrary;
    const {map} = plane;
    const cell = (value, [min, max]) => Math.floor((value - min) / (max - min) * map.cells);
    const column = cell(group.sites[5].p[0], map.x);
    const row = cell(group.sites[5].p[1], map.y);
    return map.errors_mm[row * map.cells + column] / 1e3;
  });
  assert.ok(atExample < uncorrected / 2, `${atExample} of ${uncorrected}`);
});

test('opens every group; sliders and keys move the cross; the time slider works', async () => {
  const groups = await page.evaluate(() => window.stridewireLibrary.library.groups.length);
  assert.ok(groups >= 3);
  for (let g = 0; g < groups; ++g) {
    const before = await stepsShown();
    await page.selectOption('#group', String(g));
    await stepShown(before);
    await settled();
    await waitFor('its error map is shown', () => page.evaluate(
      () => window.stridewireLibrary.plane.map !== null));
  }
  const slider = page.locator('.sliders input').first();
  const before = await requested();
  await slider.focus();
  await page.keyboard.press('ArrowRight');
  assert.notDeepEqual(await requested(), before);
  await settled();
  await page.locator('.plane').focus();
  const beforeKey = await requested();
  await page.keyboard.press('ArrowLeft');
  assert.notDeepEqual(await requested(), beforeKey);
  await page.getByRole('button', {name: 'Reset to mean'}).click();
  await settled();
  await page.locator('#time').focus();
  await page.keyboard.press('Home');
  await page.keyboard.press('PageUp');
  const root = () => page.evaluate(
    () => [...window.stridewireLibrary.preview.pose.rootsM.subarray(0, 3)]);
  const same = (a, b) => a.every((v, i) => v === b[i]);
  const still = await waitFor('playback is paused', async () => {
    const first = await root();
    await sleep(300);
    const second = await root();
    return same(first, second) ? second : null;
  });
  await page.getByRole('button', {name: 'Play'}).click();
  await waitFor('the movement plays', async () => !same(await root(), still));
  await page.locator('#corrected').uncheck();
  await waitFor('an uncorrected step is shown', () => page.evaluate(
    () => window.stridewireLibrary.step.iterations === 0));
  assert.deepEqual(errors, []);
});

test('reports that the server does not respond', async () => {
  await server.kill();
  await page.getByRole('button', {name: 'Reset to mean'}).click();
  await waitFor('the error is shown', () => page.evaluate(() =>
    document.querySelector('.notice:not([hidden])')?.textContent.includes('No server responds')));
});
