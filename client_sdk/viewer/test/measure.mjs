// Frames a second and memory with 1, 100 and 1,000 walking avatars, bodies and lines, and the time from load
// to figures:
//   node test/measure.mjs http://127.0.0.1:7421/
// Processor time is that of all the browser's processes: it hardly depends on what else runs.
// Each crowd lives in a world of its own, spawned and walked by the page itself.

import {launch} from './browser.mjs';

const link = process.argv[2];
if (!link) {
  console.error('usage: measure.mjs LINK');
  process.exit(2);
}
const browser = await launch();

const system = await browser.newBrowserCDPSession();
async function processorS() {
  const {processInfo} = await system.send('SystemInfo.getProcessInfo');
  return processInfo.reduce((sum, {cpuTime}) => sum + cpuTime, 0);
}

const loads = [];
for (let i = 0; i < 5; ++i) {
  const page = await browser.newPage({viewport: {width: 1280, height: 720}});
  await page.goto(link);
  await page.waitForFunction(() => window.stridewire?.stats.firstFigureMs > 0);
  loads.push(Math.round(await page.evaluate(() => window.stridewire.stats.firstFigureMs)));
  await page.close();
}
console.log(`load to figures, ms: ${loads.sort((a, b) => a - b).join(' ')}`);

for (const count of [1, 100, 1000]) {
  for (const style of ['bodies', 'lines']) {
    const page = await browser.newPage({viewport: {width: 1280, height: 720}});
    const session = await page.context().newCDPSession(page);
    await page.goto(`${link}?world=measure-${style}-${count}&figures=${style}`);
    await page.waitForFunction(() => window.stridewire?.worlds[0]?.world.skeleton);
    await page.evaluate(async (n) => {
      const {world} = window.stridewire.worlds[0];
      const items = Array.from({length: n}, (_, i) => ({
        positionM: [(i % 32) * 1.5, 0, Math.floor(i / 32) * 1.5], headingRad: 0}));
      const reply = await world.spawn(items);
      const steps = reply.items.flatMap(({avatar}) => Array.from(
        {length: 60}, () => ({avatar, type: 'step', lengthM: 0.6})));
      for (let i = 0; i < steps.length; i += 6000) await world.request(steps.slice(i, i + 6000));
    }, count);
    await page.waitForFunction((n) => window.stridewire.sampled()[0].avatars.length === n, count);
    await page.waitForTimeout(22000);  // Till the recording is full.
    const before = await page.evaluate(() => ({...window.stridewire.stats, ms: performance.now()}));
    const usedBefore = await processorS();
    await page.waitForTimeout(10000);
    const used = await processorS() - usedBefore;
    const after = await page.evaluate(() => ({...window.stridewire.stats, ms: performance.now(),
      recorded: window.stridewire.worlds[0].world.recording.bytes, draw: window.stridewire.draw}));
    await session.send('HeapProfiler.collectGarbage');
    const heap = await page.evaluate(() => performance.memory.usedJSHeapSize);
    const seconds = (after.ms - before.ms) / 1000;
    const frames = after.framesDrawn - before.framesDrawn;
    console.log(`${count} ${style}: ${(frames / seconds).toFixed(1)} frames/s, ` +
      `${(used * 1000 / frames).toFixed(1)} ms of processor time a frame, ` +
      `heap ${(heap / 1e6).toFixed(1)} MB, buffered ${(after.bufferedBytes / 1e6).toFixed(1)} MB, ` +
      `${((after.bytesReceived - before.bytesReceived) / seconds / 1e3).toFixed(0)} KB/s, ` +
      `${(after.decodeNsPerPose / 1e3).toFixed(2)} us/pose, ${after.draw.calls} calls, ` +
      `${after.draw.triangles} triangles, ${after.draw.lines} lines`);
    await page.close();
  }
}
await browser.close();
