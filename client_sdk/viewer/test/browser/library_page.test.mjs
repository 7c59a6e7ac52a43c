// The animator's page in a real browser: what is dragged, chosen and switched has its effect, and what
// is drawn is what the server's library gives.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {launch} from '../browser.mjs';
import {Server, keep, openIn, sleep, until} from './support.mjs';

let server;
let browser;
let context;
let page;
let errors;

before(async () => {
  server = await Server.start();
  browser = await launch();
  context = await browser.newContext({viewport: {width: 1280, height: 720}, colorScheme: 'light'});
  ({page, errors} = await openIn(context, `http://127.0.0.1:${server.httpPort}/library.html`));
  await stepShown(0);
});

after(async () => {
  await browser?.close();
  await server?.kill();
});

const stepShown = (after) => until('a step is shown', () => page.evaluate(
  (count) => window.stridewireLibrary?.stepsShown > count, after));
const shown = () => page.evaluate(() => window.stridewireLibrary.stepsShown);
const wanted = () => page.evaluate(() => [...window.stridewireLibrary.wanted]);
const settled = () => until('the step is that of the parameters wanted', () => page.evaluate(() => {
  const {step, wanted} = window.stridewireLibrary;
  return step && step.requested.length === wanted.length &&
    step.requested.every((v, l) => Math.abs(v - wanted[l]) < 2e-5);
}));
/** Where parameters lie on the page. */
const placeOf = (p) => page.evaluate((values) => {
  const {plane} = window.stridewireLibrary;
  const box = plane.element.getBoundingClientRect();
  const at = plane.place(values);
  return {x: box.left + at.x, y: box.top + at.y};
}, p);

test('dragging the cross changes the step at once', async () => {
  const before = await wanted();
  const from = await placeOf(before);
  const stepsBefore = await shown();
  await page.mouse.move(from.x, from.y);
  await page.mouse.down();
  for (let i = 1; i <= 8; ++i) await page.mouse.move(from.x + 3 * i, from.y - 4 * i);
  await stepShown(stepsBefore);  // Still held down.
  await page.mouse.up();
  await settled();
  const after = await wanted();
  assert.ok(after[0] > before[0] + 0.02 && after[1] > before[1] + 0.02, `${before}, then ${after}`);
  const step = await page.evaluate(() => window.stridewireLibrary.step);
  // Corrected: the step measures what was asked for, to a hundredth of a millimetre.
  step.measured.forEach((v, l) => assert.ok(Math.abs(v - after[l]) < 5e-5, `${step.measured}`));
  const last = step.roots_m.length - 1;
  assert.ok(step.roots_m[last] > 0.2, 'the figure went ahead');
});

test('an example is played beside the step of its parameters, and they are the same', async () => {
  const sites = await page.evaluate(() => window.stridewireLibrary.group.sites);
  const chosen = 5;
  const at = await placeOf(sites[chosen].p);
  await page.mouse.click(at.x, at.y);
  await settled();
  await until('the example is there', () => page.evaluate(
    () => window.stridewireLibrary.stage.example !== null));
  assert.deepEqual((await wanted()).map((v) => Math.round(1e5 * v)),
    sites[chosen].p.map((v) => Math.round(1e5 * v)));
  const {step, example} = await page.evaluate(() => {
    const {stage} = window.stridewireLibrary;
    return {step: stage.step, example: stage.example};
  });
  assert.equal(step.rotations.length, example.rotations.length);
  step.rotations.forEach((v, i) => assert.ok(Math.abs(v - example.rotations[i]) < 1e-3));
  // Both are drawn, a metre apart.
  await until('two figures are drawn', () => page.evaluate(
    () => window.stridewireLibrary.stage.pose.count === 2));
  const roots = await page.evaluate(() => [...window.stridewireLibrary.stage.pose.rootsM]);
  assert.ok(Math.abs(roots[0] - roots[3] - 1.1) < 0.02 && Math.abs(roots[2] - roots[5]) < 0.02, `${roots}`);
  await keep(page, 'library');
});

test('the map of errors is dark at the examples and follows its switch', async () => {
  const lightest = () => page.evaluate(() => {
    const {plane} = window.stridewireLibrary;
    return plane.map === null ? null : plane.map.largest_m;
  });
  const plain = await until('a map', lightest);
  await page.selectOption('#map', 'corrected');
  await until('the corrected map', async () => await lightest() < plain / 5);
  await page.selectOption('#map', 'none');
  assert.equal(await lightest(), null);
  await page.selectOption('#map', 'plain');
  await until('the map again', async () => await lightest() === plain);
  const atExample = await page.evaluate(() => {
    const {plane, group} = window.stridewireLibrary;
    const {map} = plane;
    const column = Math.floor((group.sites[5].p[0] - map.x[0]) / (map.x[1] - map.x[0]) * map.cells);
    const row = Math.floor((group.sites[5].p[1] - map.y[0]) / (map.y[1] - map.y[0]) * map.cells);
    return map.errors_mm[row * map.cells + column] / 1e3;
  });
  assert.ok(atExample < plain / 2, `${atExample} of ${plain}`);
});

test('every group opens, sliders and keys move the cross, time can be scrubbed', async () => {
  const groups = await page.evaluate(() => window.stridewireLibrary.library.groups.length);
  assert.ok(groups >= 3);
  for (let g = 0; g < groups; ++g) {
    const before = await shown();
    await page.selectOption('#group', String(g));
    await stepShown(before);
    await settled();
    await until('its map', () => page.evaluate(() => window.stridewireLibrary.plane.map !== null));
  }
  const slider = page.locator('.sliders input').first();
  const before = await wanted();
  await slider.focus();
  await page.keyboard.press('ArrowRight');
  assert.notDeepEqual(await wanted(), before);
  await settled();
  await page.locator('.plane').focus();
  const beforeKey = await wanted();
  await page.keyboard.press('ArrowLeft');
  assert.notDeepEqual(await wanted(), beforeKey);
  await page.getByRole('button', {name: 'Middle'}).click();
  await settled();
  await page.locator('#time').focus();
  await page.keyboard.press('Home');
  await page.keyboard.press('PageUp');
  const root = () => page.evaluate(() => [...window.stridewireLibrary.stage.pose.rootsM.subarray(0, 3)]);
  const same = (a, b) => a.every((v, i) => v === b[i]);
  const still = await until('it stands still', async () => {
    const first = await root();
    await sleep(300);
    const second = await root();
    return same(first, second) ? second : null;
  });
  await page.getByRole('button', {name: 'Play'}).click();
  await until('it plays', async () => !same(await root(), still));
  await page.locator('#corrected').uncheck();
  await until('an uncorrected step', () => page.evaluate(
    () => window.stridewireLibrary.step.iterations === 0));
  assert.deepEqual(errors, []);
});

test('a server that went away is said so', async () => {
  await server.kill();
  await page.getByRole('button', {name: 'Middle'}).click();
  await until('the page says so', () => page.evaluate(
    () => document.querySelector('.notice:not([hidden])')?.textContent.includes('No server answers')));
});
