import assert from 'node:assert/strict';
import {test} from 'node:test';
import WebSocket from 'ws';
import {RestartProbe} from './support/restart_probe';
import {ServerProcess, programs, until} from './support/server_process';

const skip = programs === undefined &&
  'set STRIDEWIRE_BIN to a folder of built programs, for example build/release/bin';
if (skip) console.log(`restarts.test.ts is skipped: ${skip}`);

/** Memory of JavaScript and of the WebAssembly module, in MB. */
function memoryMB(): number {
  globalThis.gc!();
  const {heapUsed, arrayBuffers} = process.memoryUsage();
  return (heapUsed + arrayBuffers) / 1e6;
}

// Same as ClientAndServer.SurvivesManyRestarts of the C++ client.
test('survives many restarts of the server', {skip}, async () => {
  const restarts = Number(process.env['STRIDEWIRE_RESTARTS'] ?? 3);
  let server = await ServerProcess.start();
  const probe = await RestartProbe.start({url: server.url, webSocket: WebSocket});
  let firstMB = 0;
  try {
    for (let round = 1; round <= restarts; ++round) {
      probe.request();
      probe.request();
      const {ended} = probe.report;
      await until('a step has ended', () => probe.report.ended > ended);
      probe.request();  // It may be lost with the session, which its reply reports.
      const {port, httpPort} = server;
      await server.kill('SIGKILL');
      probe.request();
      server = await ServerProcess.start(port, httpPort);
      await until('the client has noticed the lost session',
                  () => probe.report.lostSessions === round);
      probe.request();
      const restored = probe.report.ended;
      await until('a step has ended in the new session', () => probe.report.ended > restored);
      if (round === Math.ceil(restarts / 5)) firstMB = memoryMB();
    }
    await until('all requests are answered',
                () => probe.report.answered === probe.report.requests);
    const {errors, largestM, segments, reconnects, requests, lost, samples} = probe.report;
    assert.deepEqual(errors, []);
    assert.ok(largestM < 1e-3, `a pose moved ${largestM} m too far`);
    assert.equal(segments, restarts);
    assert.equal(reconnects, restarts);
    const grownMB = memoryMB() - firstMB;
    console.log(`${restarts} restarts: ${requests} requests, ${lost} lost with their ` +
      `session; ${samples} samples, ${segments} changes of segment; memory ` +
      `${firstMB.toFixed(1)} MB after a fifth of the restarts, ${grownMB.toFixed(2)} MB more at ` +
      'the end');
  } finally {
    probe.close();
    await server.kill();
  }
});
