// Measures the viewer: the time from navigation to the first avatars, and frame rate, processor
// time and memory with 1, 100 and 1,000 walking avatars, drawn as bodies and as lines.
//
//   node test/measure.mjs http://127.0.0.1:7421/ [COUNT STYLE] [FILE.png]
//
// Processor time is the total of all browser processes, which hardly depends on other programs. The
// page spawns each crowd in a new world. Environment: STRIDEWIRE_QUERY is appended to the URL,
// STRIDEWIRE_WARM_S is the time before the measurement (default 22 s, when the recording is full).

import {DevToolsBrowser} from './devtools_browser.mjs';

const [url, onlyCount, onlyStyle, file] = process.argv.slice(2);
if (!url) {
  console.error('usage: measure.mjs URL [COUNT STYLE] [FILE.png]');
  process.exit(2);
}
const warmS = Number(process.env.STRIDEWIRE_WARM_S || 22);
const query = process.env.STRIDEWIRE_QUERY || '';
const sleep = (seconds) => new Promise((resolve) => setTimeout(resolve, 1000 * seconds));
const browser = await DevToolsBrowser.launch();

if (!onlyCount) {
  const loads = [];
  for (let i = 0; i < 5; ++i) {
    const page = await browser.open(url, 1280, 720);
    await page.waitFor(() => window.stridewire.stats.firstFigureMs > 0);
    loads.push(Math.round(await page.evaluate(() => window.stridewire.stats.firstFigureMs)));
    await page.close();
  }
  console.log(`navigation to first avatars, ms: ${loads.sort((a, b) => a - b).join(' ')}`);
}

const crowds = onlyCount ? [[Number(onlyCount), onlyStyle]] :
  [1, 100, 1000].flatMap((count) => [[count, 'bodies'], [count, 'lines']]);
for (const [count, style] of crowds) {
  const world = `measure-${style}-${count}-${process.pid}`;
  const page = await browser.open(
    `${url}?world=${world}&figures=${style}&${query}`, 1280, 720);
  await page.waitFor(() => window.stridewire.worlds[0].world.skeleton !== null);
  await page.evaluate(async (n) => {
    const {world} = window.stridewire.worlds[0];
    const items = Array.from({length: n}, (_, i) => ({
      positionM: [(i % 32) * 1.5, 0, Math.floor(i / 32) * 1.5], headingRad: 0}));
    const reply = await world.spawn(items);
    const steps = reply.items.flatMap(({avatar}) => Array.from(
      {length: 60}, () => ({avatar, type: 'step', lengthM: 0.6})));
    for (let i = 0; i < steps.length; i += 6000) await world.request(steps.slice(i, i + 6000));
  }, count);
  await page.waitFor((n) => window.stridewire.sampled()[0].avatars.length === n, count);
  await sleep(warmS);
  const before = await page.evaluate(() => ({...window.stridewire.stats, ms: performance.now()}));
  const usedBefore = await browser.processorS();
  await sleep(10);
  const used = await browser.processorS() - usedBefore;
  const after = await page.evaluate(() => ({...window.stridewire.stats, ms: performance.now(),
    recorded: window.stridewire.worlds[0].world.recording.bytes, draw: window.stridewire.draw}));
  if (file) await page.screenshot(file);
  await page.send('HeapProfiler.collectGarbage');
  const heap = await page.evaluate(() => performance.memory.usedJSHeapSize);
  const seconds = (after.ms - before.ms) / 1000;
  const frames = after.framesDrawn - before.framesDrawn;
  console.log(`${count} ${style}: ${(frames / seconds).toFixed(1)} frames/s, ` +
    `${(used * 1000 / frames).toFixed(1)} ms of processor time per frame, ` +
    `level ${after.draw.level}, ` +
    `heap ${(heap / 1e6).toFixed(1)} MB, buffered ${(after.bufferedBytes / 1e6).toFixed(1)} MB, ` +
    `${((after.bytesReceived - before.bytesReceived) / seconds / 1e3).toFixed(0)} KB/s, ` +
    `${(after.decodeNsPerPose / 1e3).toFixed(2)} us/pose, ${after.draw.calls} calls, ` +
    `${after.draw.triangles} triangles, ${after.draw.lines} lines`);
  await page.close();
}
await browser.close();
