// Takes the screenshots of docs/pictures from a running demo server, as WebP files:
//
//   node test/pictures.mjs http://127.0.0.1:7421/ ../../docs/pictures [NAME]
//
// With NAME, takes only pictures whose names contain it.

import {writeFileSync} from 'node:fs';
import {join} from 'node:path';

import {launch} from './browser.mjs';

const [url, folder, part = ''] = process.argv.slice(2);
if (!url || !folder) {
  console.error('usage: pictures.mjs URL FOLDER [NAME]');
  process.exit(2);
}
const sizes = [[1280, 720], [1920, 1080], [390, 844]];
// The finest quality, as with a GPU, although frames take long in software.
const bothWorlds = 'world=generated&world=captured&quality=high';
const browser = await launch();

async function picture(name, width, height, colorScheme, query, prepare) {
  if (!name.includes(part)) return;
  const page = await browser.newPage({viewport: {width, height}, colorScheme,
    hasTouch: width < 500});
  page.on('pageerror', (error) => console.error(name, error.message));
  await page.goto(`${url}?${query}`);
  await page.waitForFunction(() => window.stridewire?.worlds[0]?.world.skeleton);
  if (!query.includes('slabs')) {
    await page.waitForFunction(() => window.stridewire.stats.firstFigureMs > 0);
    await page.waitForTimeout(6000);
  }
  if (prepare) await prepare(page);
  await save(page, name);
}

async function libraryPicture(name, width, height, colorScheme) {
  if (!name.includes(part)) return;
  const page = await browser.newPage({viewport: {width, height}, colorScheme,
    hasTouch: width < 500});
  page.on('pageerror', (error) => console.error(name, error.message));
  await page.goto(new URL('library.html', url).href);
  await page.locator('.preview').first().waitFor();
  await page.waitForTimeout(6000);
  await save(page, name);
}

async function save(page, name) {
  const file = join(folder, `${name}.webp`);
  const tools = await page.context().newCDPSession(page);
  const {data} = await tools.send('Page.captureScreenshot', {format: 'webp', quality: 90});
  writeFileSync(file, Buffer.from(data, 'base64'));
  console.log(file);
  await page.close();
}

for (const [width, height] of sizes) {
  for (const theme of ['dark', 'light']) {
    await picture(`viewer_${width}x${height}_${theme}`, width, height, theme, bothWorlds);
    await libraryPicture(`library_${width}x${height}_${theme}`, width, height, theme);
  }
}
const inspect = async (page) => {
  await page.keyboard.press('n');
  await page.keyboard.press('c');
  await page.waitForTimeout(2500);
  // Pauses during a step.
  await page.waitForFunction(() => {
    const movement = window.stridewire.inspected?.movement;
    return movement?.kind.startsWith('step') && movement.weights.length > 0 &&
      !movement.extrapolated;
  });
  await page.locator('.scene').focus();  // The space bar would press a focused button.
  await page.keyboard.press('Space');
  await page.waitForTimeout(800);
};
await picture('viewer_inspect', 1280, 720, 'dark', 'world=captured&quality=high', inspect);
await picture('viewer_inspect_phone', 390, 844, 'light', 'world=generated&quality=high', async (
  page) => {
  await page.click('button[aria-controls=panel-inspect]');
  await inspect(page);
  await page.waitForTimeout(1500);
});
// The table with the costs of several stream modes.
await picture('viewer_streams', 1280, 720, 'light', bothWorlds, async (page) => {
  await page.click('button[aria-controls=panel-commands]');
  await page.click('button[aria-controls=panel-view]');
  const choices = [
    'mode-full', 'mode-quantised', 'rate-4', 'rate-1', 'detail-root', 'detail-reduced',
    'mode-movement'];
  for (const id of choices) {
    await page.click(`label[for=${id}]`);
    await page.waitForTimeout(4000);
  }
  await page.evaluate(() => document.querySelector('.costs').scrollIntoView({block: 'end'}));
  await page.waitForTimeout(1500);
});
// Three avatars on slabs; the queued footprints of the selected one are outlined.
await picture('viewer_slabs', 1280, 720, 'dark', 'world=slabs&quality=high', async (page) => {
  await page.selectOption('#command-terrain', 'slabs');
  await page.waitForFunction(() => !window.stridewire.worlds[0].view.terrain.isFlat);
  await page.evaluate(async () => {
    const {world, view} = window.stridewire.worlds[0];
    const lanes = [-0.75, 0, 0.75];
    const {items} =
      await world.spawn(lanes.map((x) => ({positionM: [x, 0, 0.2], headingRad: 0})));
    const centres = world.terrain.boxes.map(({minM, maxM}) => (minM[1] + maxM[1]) / 2);
    await world.request(items.flatMap(({avatar}, lane) => centres.slice(0, 14).map((z, i) => {
      const x = lanes[lane] + (i % 2 === 0 ? 0.1 : -0.1);
      return {avatar, type: 'step', foot: i % 2 === 0 ? 'left' : 'right',
        atM: [x, view.terrain.heightAt(x, z), z], headingRad: 0};
    })));
  });
  await page.waitForTimeout(4500);
  await page.locator('.scene').focus();
  for (let i = 0; i < 2; ++i) await page.keyboard.press('n');
  await page.keyboard.press('c');
  for (let i = 0; i < 9; ++i) await page.keyboard.press('ArrowRight');
  for (let i = 0; i < 3; ++i) await page.keyboard.press('ArrowUp');
  await page.waitForTimeout(2000);
});
await browser.close();
