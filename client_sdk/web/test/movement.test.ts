import assert from 'node:assert/strict';
import {mkdtempSync, readFileSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {test} from 'node:test';
import {fileURLToPath} from 'node:url';
import WebSocket from 'ws';
import {Client} from '../src/client';
import type {LibraryCache} from '../src/client_types';
import {createCrowdPose} from '../src/pose_buffers';
import type {CrowdPose} from '../src/types';
import {replayMovements} from './support/movement_replay';
import {ServerProcess, programs, run, until} from './support/server_process';

const skip = programs === undefined &&
  'set STRIDEWIRE_BIN to a folder of built programs, for example build/release/bin';
if (skip) console.log(`movement.test.ts is skipped: ${skip}`);

const avatars = 64;
const ticks = Number(process.env['STRIDEWIRE_TICKS'] || 1000);
const seed = 1;

test('evaluates the same poses as the C++ client, to the bit', {skip}, async () => {
  const folder = mkdtempSync(join(tmpdir(), 'stridewire-movement-'));
  try {
    const path = join(folder, 'stream');
    await run('web_movement_stream', ['builtin', `${avatars}`, `${ticks}`, `${seed}`, path]);
    const bytes = readFileSync(path);
    const file =
        bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length) as ArrayBuffer;
    const {differences, ...counts} = await replayMovements(file);
    assert.deepEqual(counts, {ticks, poses: ticks * avatars}, `seed ${seed}`);
    assert.deepEqual(differences, [], `seed ${seed}`);
    console.log(`${ticks} ticks of ${avatars} avatars are equal, seed ${seed}`);
    // The comparison notices a single bit.
    const view = new DataView(file);
    let at = 0;
    const size = (): number => 16 + view.getUint32(at, true);
    while (view.getUint32(at + 4, true) === 0) at += size();
    view.setUint32(at + 4, view.getUint32(at + 4, true) ^ 1, true);
    const changed = await replayMovements(file.slice(0, at + size()));
    assert.equal(changed.differences.length, 1);
  } finally {
    rmSync(folder, {recursive: true, force: true});
  }
});

/** A cache in memory that counts calls. */
class MemoryCache implements LibraryCache {
  readonly files = new Map<string, Uint8Array>();
  loads = 0;
  stores = 0;
  load(hash: string): Promise<Uint8Array | null> {
    ++this.loads;
    return Promise.resolve(this.files.get(hash) ?? null);
  }
  store(hash: string, file: Uint8Array): Promise<void> {
    ++this.stores;
    this.files.set(hash, file);
    return Promise.resolve();
  }
}

test('keeps libraries in a cache, and refuses damaged and foreign files', {skip}, async () => {
  const server = await ServerProcess.start();
  /** Observes a world in movement mode and returns the bytes that were fetched for its library. */
  const fetchedBytes = async (libraryCache: LibraryCache | null): Promise<number> => {
    const client = new Client({url: server.url, webSocket: WebSocket, libraryCache});
    try {
      client.connect();
      const world = client.joinWorld('plaza');
      await world.spawn([{positionM: [0, 0, 0], headingRad: 0}]);
      assert.ok((await world.observe({mode: 'movement'}).reply).ok);
      await until('poses arrive', () => world.avatars().length > 0);
      assert.equal(client.statistics.invalidFrames, 0);
      return client.statistics.libraryBytesReceived;
    } finally {
      client.close();
    }
  };
  try {
    const cache = new MemoryCache();
    const size = await fetchedBytes(cache);
    assert.ok(size > 100_000, `${size} bytes`);
    assert.deepEqual([cache.loads, cache.stores], [1, 1]);
    assert.equal(await fetchedBytes(cache), 0);
    assert.deepEqual([cache.loads, cache.stores], [2, 1]);

    const [hash, file] = [...cache.files][0]!;
    assert.match(hash, /^[0-9a-f]{32}$/);
    const damaged = file.slice();
    damaged[damaged.length >> 1]! ^= 1;
    const foreign = readFileSync(fileURLToPath(new URL(import.meta.url)));
    for (const bad of [damaged, foreign, file.subarray(0, 100), new Uint8Array(0), 'text']) {
      cache.files.set(hash, bad as Uint8Array);
      assert.equal(await fetchedBytes(cache), size);
      assert.deepEqual(cache.files.get(hash), file);  // Replaced by the intact file.
    }

    assert.equal(await fetchedBytes(null), size);
    const failing: LibraryCache = {
      load: () => Promise.reject(new Error('refused')),
      store: () => Promise.reject(new Error('full')),
    };
    assert.equal(await fetchedBytes(failing), size);
    const throwing: LibraryCache = {
      load: () => { throw new Error('refused'); },
      store: () => { throw new Error('full'); },
    };
    assert.equal(await fetchedBytes(throwing), size);
    const hanging: LibraryCache = {
      load: () => new Promise(() => {}), store: () => new Promise(() => {})
    };
    assert.equal(await fetchedBytes(hanging), size);
  } finally {
    await server.kill();
  }
});

test('records evaluated poses', {skip}, async () => {
  const server = await ServerProcess.start();
  const client = new Client({url: server.url, webSocket: WebSocket, poseHistory: 4096});
  try {
    client.connect();
    const world = client.joinWorld('plaza');
    await world.spawn([1, 2, 3].map(
        (avatar) => ({avatar, positionM: [avatar, 0, 0] as const, headingRad: 0})));
    void world.observe({mode: 'movement'});
    const finished = new Set<number>();
    world.on('event', ({type, avatar}) => type === 'finished' && finished.add(avatar));
    await world.request([1, 2].map((avatar) => ({avatar, type: 'step', lengthM: 0.5})));
    await until('the steps have finished', () => finished.size === 2);
    const {firstTimeS, lastTimeS} = world.recording;
    assert.ok(lastTimeS - firstTimeS > 0.5);
    const [live, recorded] = [createCrowdPose(), createCrowdPose()];
    let compared = 0;
    // Poses of one shard may end before those of the other. Only live poses are then extrapolated.
    for (let timeS = firstTimeS + 0.1; timeS < lastTimeS - 0.1; timeS += 0.013) {
      assert.equal(world.sampleAll(timeS, live), 3);
      assert.equal(world.recording.sampleAll(timeS, recorded), 3);
      assert.deepEqual(recorded.flags.subarray(0, 3), live.flags.subarray(0, 3));
      for (let i = 0; i < 9; ++i) {
        assert.ok(Math.abs(recorded.rootsM[i]! - live.rootsM[i]!) < 2e-4);
      }
      for (let i = 0; i < 3 * live.jointCount; ++i) {
        const at = (crowd: CrowdPose) => crowd.rotations.subarray(4 * i, 4 * i + 4);
        const cosine = at(live).reduce((sum, x, j) => sum + x * at(recorded)[j]!, 0);
        assert.ok(Math.abs(cosine) > 0.9999, `joint ${i} at ${timeS}: ${cosine}`);
        ++compared;
      }
    }
    assert.ok(compared > 1000, `${compared}`);
  } finally {
    client.close();
    await server.kill();
  }
});
