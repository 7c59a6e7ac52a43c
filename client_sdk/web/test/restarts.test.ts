import assert from 'node:assert/strict';
import {test} from 'node:test';
import WebSocket from 'ws';
import {Client} from '../src/client';
import {createPose} from '../src/pose_buffers';
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
  const client = new Client({
    url: server.url, webSocket: WebSocket, seed: 1, respawn: true, recordingS: 2});
  client.connect();
  const world = client.joinWorld('plaza');
  assert.ok((await world.spawn([{avatar: 1, positionM: [0, 0, 0], headingRad: 0}])).ok);
  assert.ok((await world.observe({mode: 'full'}).reply).ok);

  let lostSessions = 0;
  client.on('sessionLost', () => void ++lostSessions);
  // Each request is one step. Counts of its replies and of its events:
  const replies = new Map<bigint, string>();
  const starts = new Map<bigint, number>();
  const ends = new Map<bigint, number>();
  const count = (counts: Map<bigint, number>, id: bigint): void =>
      void counts.set(id, (counts.get(id) ?? 0) + 1);
  world.on('event', (event) => {
    if (!('requestId' in event) || event.requestId === 0n) return;
    if (event.type === 'started') count(starts, event.requestId);
    if (event.type === 'finished') count(ends, event.requestId);
  });
  let nextId = 1n;
  const request = (): void => {
    const requestId = nextId++;
    void world.request([{avatar: 1, requestId, type: 'step', lengthM: 0.5}]).then((reply) => {
      assert.ok(!replies.has(requestId));
      replies.set(requestId, reply.status);
    });
  };

  // Sampled poses do not jump, except where their segment changes.
  const pose = createPose();
  let samples = 0;
  let segments = 0;
  let largestM = 0;
  let last: {timeS: number, segment: number, rootM: number[]} | null = null;
  const sampler = setInterval(() => {
    const timeS = client.renderTimeS();
    if (timeS === null || world.sample(1, timeS, pose) === 'missing') return;
    const rootM = [...pose.rootM];
    ++samples;
    if (last !== null && last.segment !== pose.segment) ++segments;
    if (last !== null && last.segment === pose.segment) {
      const movedM = Math.hypot(...rootM.map((value, i) => value - last!.rootM[i]!));
      // The speed of no step exceeds 3 m/s.
      largestM = Math.max(largestM, movedM - 3 * Math.abs(timeS - last.timeS));
    }
    last = {timeS, segment: pose.segment, rootM};
  }, 5);

  let firstMB = 0;
  try {
    for (let round = 1; round <= restarts; ++round) {
      request();
      request();
      const ended = ends.size;
      await until('a step has ended', () => ends.size > ended);
      request();  // It may be lost with the session, which its reply reports.
      const {port, httpPort} = server;
      await server.kill('SIGKILL');
      request();
      server = await ServerProcess.start(port, httpPort);
      await until('the client has noticed the lost session', () => lostSessions === round);
      request();
      const restored = ends.size;
      await until('a step has ended in the new session', () => ends.size > restored);
      if (round === Math.ceil(restarts / 5)) firstMB = memoryMB();
    }
    await until('all requests are answered', () => replies.size === Number(nextId) - 1);
    const accepted = [...replies].filter(([, status]) => status === 'ok');
    const lost = [...replies].filter(([, status]) => status === 'session_lost');
    assert.equal(accepted.length + lost.length, replies.size);
    for (const counts of [starts, ends]) {
      for (const [id, times] of counts) assert.equal(times, 1, `request ${id} ran ${times} times`);
    }
    assert.ok(largestM < 1e-3, `a pose moved ${largestM} m too far`);
    assert.equal(segments, restarts);
    assert.equal(client.statistics.reconnects, restarts);
    const grownMB = memoryMB() - firstMB;
    console.log(`${restarts} restarts: ${replies.size} requests, ${lost.length} lost with their ` +
      `session; ${samples} samples, ${segments} changes of segment; memory ` +
      `${firstMB.toFixed(1)} MB after a fifth of the restarts, ${grownMB.toFixed(2)} MB more at ` +
      'the end');
  } finally {
    clearInterval(sampler);
    client.close();
    await server.kill();
  }
});
