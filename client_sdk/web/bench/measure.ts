// Measures received bytes per second, time per pose and per call, and memory, with a real server.
import WebSocket from 'ws';
import {Client} from '../src/client';
import {createCrowdPose} from '../src/pose_buffers';
import type {CrowdPose, PoseMode} from '../src/types';
import {decodeMessage} from '../src/testing';
import {MessageType} from '../generated/messages';
import {ServerProcess, until} from '../test/support/server_process';

function median(values: number[]): number {
  values.sort((a, b) => a - b);
  return values[values.length >> 1]!;
}

/** Returns the median time per call in microseconds. Each round has `calls` calls. */
function time(rounds: number, calls: number, call: (i: number) => void): number {
  const us: number[] = [];
  for (let round = 0; round < rounds; ++round) {
    const startedMs = performance.now();
    for (let i = 0; i < calls; ++i) call(i);
    us.push(1000 * (performance.now() - startedMs) / calls);
  }
  return median(us);
}

function memory(): number {
  globalThis.gc!();
  globalThis.gc!();
  const {heapUsed, arrayBuffers} = process.memoryUsage();
  return heapUsed + arrayBuffers;
}

async function measure(mode: PoseMode, count: number): Promise<void> {
  const server = await ServerProcess.start();
  const frames: ArrayBuffer[] = [];
  class RecordingSocket extends WebSocket {
    constructor(url: string) {
      super(url);
      this.on('message', (data) => {
        if (data instanceof ArrayBuffer && data.byteLength > 40 && frames.length < 60 &&
            [MessageType.PoseBatch as number, MessageType.Movements].includes(
                new DataView(data).getUint16(6, true))) {
          frames.push(data);
        }
      });
    }
  }
  const before = memory();
  const client = new Client({url: server.url, webSocket: RecordingSocket});
  client.connect();
  const world = client.joinWorld('plaza');
  const side = Math.ceil(Math.sqrt(count));
  await world.spawn(Array.from({length: count}, (_, i) => ({
    positionM: [2 * (i % side), 0, 2 * Math.floor(i / side)] as const, headingRad: 0,
  })));
  world.on('event', (event) => {
    if (event.type !== 'idle') return;
    void world.request(Array.from({length: 8}, () => ({
      avatar: event.avatar, type: 'step' as const, lengthM: 0.5, turnRad: 0.1})));
  });
  void world.observe({mode});
  await until('poses of all avatars have arrived', () => world.avatars().length === count);
  await new Promise((resolve) => setTimeout(resolve, 3000));
  const first = client.statistics;
  const firstMs = performance.now();
  await new Promise((resolve) => setTimeout(resolve, 4000));
  const last = client.statistics;
  const seconds = (performance.now() - firstMs) / 1000;
  const crowd: CrowdPose = createCrowdPose();
  const now = client.renderTimeS()!;
  world.sampleAll(now, crowd);
  const calls = Math.max(20, Math.round(20_000 / count));
  const live = time(9, calls, (i) => void world.sampleAll(now - 0.05 - (i % 16) / 500, crowd));
  const recorded = time(9, calls,
                        (i) => void world.recording.sampleAll(now - 2 + (i % 100) / 200, crowd));
  const checked = time(9, 10 * frames.length,
                       (i) => void decodeMessage(frames[i % frames.length]!, 'server'));
  console.log(JSON.stringify({
    mode,
    avatars: count,
    joints: world.skeleton!.jointCount,
    bytesPerS: Math.round((last.bytesReceived - first.bytesReceived) / seconds),
    bytesPerPose: Number(((last.poseBytesReceived - first.poseBytesReceived) /
                          (last.posesReceived - first.posesReceived)).toFixed(2)),
    posesPerS: Math.round((last.posesReceived - first.posesReceived) / seconds),
    decodeNsPerPose: Math.round(last.decodeNsPerPose),
    frameCheckUs: Number(checked.toFixed(2)),
    sampleAllUs: Number(live.toFixed(1)),
    recordingSampleAllUs: Number(recorded.toFixed(1)),
    recordedMB: Number((world.recording.bytes / 1e6).toFixed(2)),
    memoryMB: Number(((memory() - before) / 1e6).toFixed(2)),
  }));
  client.close();
  await server.kill();
}

const modes = process.argv.length > 2 ? [process.argv[2] as PoseMode]
                                      : ['full', 'quantised', 'movement'] as const;
for (const mode of modes) {
  for (const count of [1, 100, 1000]) await measure(mode, count);
}
process.exit(0);
