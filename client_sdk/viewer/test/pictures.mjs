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
const both = 'world=generated&world=captured&figures=bodies';
const browser = await launch();

async function picture(name, width, height, colorScheme, query, prepare) {
  if (!name.includes(part)) return;
  const page = await browser.newPage({viewport: {width, height}, colorScheme, hasTouch: width < 500});
  page.on('pageerror', (error) => console.error(name, error.message));
  await page.goto(`${link}?${query}`);
  await page.waitForFunction(() => window.stridewire?.stats.firstFigureMs > 0);
  await page.waitForTimeout(6000);
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
    return movement?.kind.startsWith('step') && movement.weights.length > 0;
  });
  await page.locator('.scene').focus();  // On a button the space bar would press that.
  await page.keyboard.press('Space');
  await page.waitForTimeout(800);
};
await picture('viewer_inspect', 1280, 720, 'dark', 'world=captured&figures=bodies', inspect);
await picture('viewer_inspect_phone', 390, 844, 'light', 'world=generated&figures=bodies', async (page) => {
  await page.click('button[aria-controls=panel-inspect]');
  await inspect(page);
  await page.waitForTimeout(1500);
});
await browser.close();
