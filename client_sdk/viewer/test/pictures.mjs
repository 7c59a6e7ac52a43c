// Takes the pictures of docs/pictures from a running demonstration:
//   node test/pictures.mjs http://127.0.0.1:7421/ ../../docs/pictures [PART OF A NAME]

import {join} from 'node:path';

import {launch} from './browser.mjs';

const [link, folder, part = ''] = process.argv.slice(2);
if (!link || !folder) {
  console.error('usage: pictures.mjs LINK FOLDER [PART OF A NAME]');
  process.exit(2);
}
const sizes = [[1280, 720], [1920, 1080], [390, 844]];
// As a graphics card draws it, however long that takes here.
const both = 'world=generated&world=captured&quality=high';
const browser = await launch();

async function picture(name, width, height, colorScheme, query, prepare) {
  if (!name.includes(part)) return;
  const page = await browser.newPage({viewport: {width, height}, colorScheme, hasTouch: width < 500});
  page.on('pageerror', (error) => console.error(name, error.message));
  await page.goto(`${link}?${query}`);
  await page.waitForFunction(() => window.stridewire?.worlds[0]?.world.skeleton);
  if (!query.includes('slabs')) {
    await page.waitForFunction(() => window.stridewire.stats.firstFigureMs > 0);
    await page.waitForTimeout(6000);
  }
  if (prepare) await prepare(page);
  const file = join(folder, `${name}.png`);
  await page.screenshot({path: file});
  console.log(file);
  await page.close();
}

for (const [width, height] of sizes) {
  for (const theme of ['dark', 'light']) {
    await picture(`viewer_${width}x${height}_${theme}`, width, height, theme, both);
  }
}
const inspect = async (page) => {
  await page.keyboard.press('n');
  await page.keyboard.press('c');
  await page.waitForTimeout(2500);
  // Till a step is on its way, then hold it.
  await page.waitForFunction(() => {
    const movement = window.stridewire.inspected?.movement;
    return movement?.kind.startsWith('step') && movement.weights.length > 0 && !movement.extrapolated;
  });
  await page.locator('.scene').focus();  // On a button the space bar would press that.
  await page.keyboard.press('Space');
  await page.waitForTimeout(800);
};
await picture('viewer_inspect', 1280, 720, 'dark', 'world=captured&quality=high', inspect);
await picture('viewer_inspect_phone', 390, 844, 'light', 'world=generated&quality=high', async (page) => {
  await page.click('button[aria-controls=panel-inspect]');
  await inspect(page);
  await page.waitForTimeout(1500);
});
// What the ways cost that poses can travel; at last few joints of them.
await picture('viewer_streams', 1280, 720, 'light', both, async (page) => {
  await page.click('button[aria-controls=panel-drive]');
  await page.click('button[aria-controls=panel-view]');
  for (const id of ['mode-full', 'mode-quantised', 'rate-4', 'rate-1', 'detail-root', 'detail-fewer']) {
    await page.click(`label[for=${id}]`);
    await page.waitForTimeout(4000);
  }
  await page.evaluate(() => document.querySelector('.costs').scrollIntoView({block: 'end'}));
  await page.waitForTimeout(1500);
});
// Footprints along the ladder of slabs, the middle one's still to come outlined.
await picture('viewer_slabs', 1280, 720, 'dark', 'world=slabs&quality=high', async (page) => {
  await page.selectOption('#drive-ground', 'stones');
  await page.waitForFunction(() => !window.stridewire.worlds[0].view.ground.flat);
  await page.evaluate(async () => {
    const {world, view} = window.stridewire.worlds[0];
    const lanes = [-0.75, 0, 0.75];
    const {items} = await world.spawn(lanes.map((x) => ({positionM: [x, 0, 0.2], headingRad: 0})));
    const centres = world.terrain.boxes.map(({minM, maxM}) => (minM[1] + maxM[1]) / 2);
    await world.request(items.flatMap(({avatar}, lane) => centres.slice(0, 14).map((z, i) => {
      const x = lanes[lane] + (i % 2 === 0 ? 0.1 : -0.1);
      return {avatar, type: 'step', foot: i % 2 === 0 ? 'left' : 'right',
        atM: [x, view.ground.heightAt(x, z), z], headingRad: 0};
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
