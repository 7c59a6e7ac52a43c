// Tests a page whose server is restarted and whose connection is cut. Environment, besides
// that of viewer.test.mjs:
// STRIDEWIRE_RESTARTS  number of restarts; 3 by default, 50 for a long test

import assert from 'node:assert/strict';
import {dirname, join} from 'node:path';
import {test} from 'node:test';
import {fileURLToPath} from 'node:url';

import {launch} from '../browser.mjs';
import {Proxy, Server, numberFrom, openInContext, serveModule, waitFor} from './support.mjs';

const restarts = numberFrom('STRIDEWIRE_RESTARTS', 3);

test('each request takes effect once, and nothing leaks', async () => {
  const support =
    join(dirname(fileURLToPath(import.meta.url)), '../../../web/test/support');
  const served = await serveModule(`import {RestartProbe} from './restart_probe';
    globalThis.start = async (url) => { globalThis.probe = await RestartProbe.start({url}); };`,
  support);
  let server = await Server.start(0, 0, ['--allowed-origins', served.origin]);
  const proxy = await Proxy.start(server.httpPort);
  const browser = await launch();
  try {
    const context = await browser.newContext();
    const {page} = await openInContext(context, `${served.origin}/`);
    const thrown = [];
    page.on('pageerror', (error) => thrown.push(String(error)));
    await waitFor('the script is loaded', () => page.evaluate(() => 'start' in window));
    await page.evaluate((url) => window.start(url), `ws://127.0.0.1:${proxy.port}/stream`);
    const request = () => page.evaluate(() => window.probe.request());
    const report = () => page.evaluate(() => window.probe.report);
    const until = (what, holds) => waitFor(what, async () => holds(await report()));

    const tools = await context.newCDPSession(page);
    /** Objects and memory of the page after a garbage collection. */
    const usage = async () => {
      await tools.send('HeapProfiler.collectGarbage');
      const count = async (type) => {
        const {result} = await tools.send('Runtime.evaluate', {expression: `${type}.prototype`});
        const {objects} = await tools.send('Runtime.queryObjects',
          {prototypeObjectId: result.objectId, objectGroup: 'counted'});
        const {result: length} = await tools.send('Runtime.callFunctionOn', {
          objectId: objects.objectId, functionDeclaration: 'function() { return this.length; }',
        });
        await tools.send('Runtime.releaseObjectGroup', {objectGroup: 'counted'});
        return length.value;
      };
      const [sockets, promises] = [await count('WebSocket'), await count('Promise')];
      const {usedSize, backingStorageSize = 0} = await tools.send('Runtime.getHeapUsage');
      return {sockets, promises, megabytes: (usedSize + backingStorageSize) / 1e6};
    };

    let first;
    for (let round = 1; round <= restarts; ++round) {
      const {ended: endedBefore} = await report();
      await request();
      await request();
      proxy.cut();  // The server keeps the session, so it executes all three requests.
      await request();
      await until('the steps around the cut have ended', (r) => r.ended === endedBefore + 3);
      await request();  // It may be lost with the session, which its reply reports.
      const {port, httpPort} = server;
      await server.kill();
      await request();
      server = await Server.start(port, httpPort, ['--allowed-origins', served.origin]);
      await until('the client has noticed the lost session', (r) => r.lostSessions === round);
      await request();
      const {ended} = await report();
      await until('a step has ended in the new session', (r) => r.ended > ended);
      await until('all requests are answered', (r) => r.answered === r.requests);
      if (round === Math.ceil(restarts / 5)) first = await usage();
    }
    const last = await usage();
    const {errors, largestM, samples, segments, reconnects, requests, lost} = await report();
    assert.deepEqual(errors, []);
    assert.deepEqual(thrown, []);
    assert.ok(largestM < 1e-3, `a pose moved ${largestM} m too far`);
    // A slow machine may add changes of segment, because displayed motion stops after 0.25 s.
    assert.ok(segments >= restarts, `${segments} changes of segment`);
    assert.equal(reconnects, 2 * restarts);
    assert.equal(last.sockets, 1);
    assert.ok(last.promises <= first.promises + 10, `${first.promises} to ${last.promises}`);
    console.log(`${restarts} restarts and ${restarts} cuts: ${requests} requests, ${lost} lost ` +
      `with their session; ${samples} samples, ${segments} changes of segment; after a fifth of ` +
      `the restarts ${JSON.stringify(first)}, at the end ${JSON.stringify(last)}`);
  } finally {
    await browser.close();
    proxy.stop();
    served.stop();
    await server.kill();
  }
});
