import assert from 'node:assert/strict';
import {test} from 'node:test';
import {createCrowdPose, createPose} from '../src/pose_buffers';
import {Status} from '../src/status';
import {PoseFlag} from '../src/types';
import * as server from './support/server_frames';
import {Harness, statusOf, summary} from './support/session_harness';

test('does not interpolate poses across a resume or a discontinuity', () => {
  const h = new Harness();
  const world = h.joined();
  const pose = createPose();
  const crowd = createCrowdPose();
  const at = (tick: number, x: number, flags = 0): void =>
      h.receive(server.poseBatch({tick}, [{avatar: 1, x, flags}]));
  at(60, 0);
  at(61, 1);
  assert.equal(world.sample(1, 60.5 / 60, pose), 'interpolated');
  assert.ok(Math.abs(pose.rootM[0]! - 0.5) < 1e-6);
  const {segment} = pose;
  at(62, 50, 1);
  assert.equal(world.sample(1, 61.5 / 60, pose), 'held');
  assert.equal(pose.rootM[0], 1);
  assert.equal(pose.segment, segment);
  h.lose();
  h.connect({resumed: true});
  h.receive(server.worldInfo(0n, 3, 'plaza'));
  at(90, 100);
  assert.equal(world.sample(1, 70 / 60, pose), 'held');
  assert.equal(pose.rootM[0], 50);
  assert.notEqual(pose.segment, segment);
  assert.ok(Math.abs(pose.heldS - 8 / 60) < 1e-9);
  assert.equal(world.recording.sampleAll(70 / 60, crowd), 1);
  assert.equal(crowd.rootsM[0], 50);
  assert.equal(crowd.flags[0], PoseFlag.held | PoseFlag.discontinuity);
  assert.equal(world.sample(1, 0.5, pose), 'missing');
  assert.equal(world.sample(2, 70 / 60, pose), 'missing');
});

test('samples a recording like live poses, within its limits of time and memory', () => {
  const h = new Harness({recordingS: 2, poseHistory: 512});
  const world = h.joined();
  for (let tick = 1; tick <= 240; ++tick) {
    const angleRad = Math.sin(tick / 9);
    // There are two shards. Avatar 5 moves from the second to the first at tick 120.
    h.receive(
        server.poseBatch({tick, shard: 0}, [
          {avatar: 9, x: tick * tick / 1000, angleRad},
          ...(tick >= 120 ? [{avatar: 5, x: tick / 60, angleRad}] : [])
        ]),
        server.poseBatch({tick, shard: 1},
                         tick < 120 ? [{avatar: 5, x: tick / 60, angleRad}] : []));
  }
  assert.ok(Math.abs(world.recording.lastTimeS - 4) < 1e-9);
  assert.ok(Math.abs(world.recording.firstTimeS - 2) < 1e-9);
  const live = createCrowdPose();
  const recorded = createCrowdPose();
  for (let timeS = 2.1; timeS < 3.9; timeS += 0.0123) {
    assert.equal(world.sampleAll(timeS, live), 2);
    assert.equal(world.recording.sampleAll(timeS, recorded), 2);
    assert.deepEqual([...recorded.avatars.subarray(0, 2)], [5, 9]);
    assert.deepEqual(recorded.rootsM.subarray(0, 6), live.rootsM.subarray(0, 6));
    assert.deepEqual(recorded.rotations.subarray(0, 16), live.rotations.subarray(0, 16));
  }
  assert.equal(world.recording.sampleAll(1.9, recorded), 0);
  const arrays = [recorded.avatars, recorded.rotations, recorded.rootsM, recorded.flags];
  world.recording.sampleAll(3, recorded);
  assert.deepEqual(arrays.map((array, i) => array === [
    recorded.avatars, recorded.rotations, recorded.rootsM, recorded.flags
  ][i]), [true, true, true, true]);

  const small = new Harness({maxRecordingBytes: 4096});
  const bounded = small.joined();
  for (let tick = 1; tick <= 100; ++tick) {
    small.receive(server.poseBatch({tick}, [{avatar: 1, x: 0}]));
    assert.ok(bounded.recording.bytes <= 4096);
  }
  assert.ok(bounded.recording.firstTimeS > 1);
});

test('reports avatars that appear and disappear', () => {
  const h = new Harness();
  const world = h.joined();
  const lists: string[] = [];
  world.on('avatars', (avatars) => lists.push([...avatars].join(' ')));
  h.receive(server.poseBatch({tick: 1, parts: 2, part: 0}, [{avatar: 7, x: 0}]),
            server.poseBatch({tick: 1, parts: 2, part: 1}, [{avatar: 3, x: 0}]),
            server.poseBatch({tick: 2}, [{avatar: 7, x: 0}]),
            server.events(1n, [{type: 'removed', avatar: 7}]));
  assert.deepEqual(lists, ['7', '3 7', '7', '']);
  // Removed avatars can be sampled at times of their poses, but not later.
  const crowd = createCrowdPose();
  assert.equal(world.sampleAll(1 / 60, crowd), 2);
  assert.equal(world.sampleAll(3 / 60, crowd), 0);
});

test('stores poses of observed avatars only', async () => {
  const h = new Harness();
  h.connect();
  const world = h.session.joinWorld('plaza', 'observer');
  h.sent();
  h.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  const some = world.observe({mode: 'full', avatars: [4, 5]});
  h.sent();
  h.receive(server.reply(2n));
  h.receive(server.poseBatch({tick: 1}, [{avatar: 4, x: 0}, {avatar: 6, x: 0}]));
  assert.deepEqual([...world.avatars()], [4]);
  const crowd = createCrowdPose();
  assert.equal(world.recording.sampleAll(1 / 60, crowd), 1);
  const stopped = some.stop();
  assert.deepEqual(summary(h.sent()), ['StopObserving 3']);
  h.receive(server.reply(3n, Status.no_such_subscription));
  assert.equal(statusOf(await stopped), 'ok');
  assert.equal(world.avatars().length, 0);
  h.receive(server.poseBatch({tick: 2}, [{avatar: 4, x: 0}]));
  assert.equal(world.avatars().length, 0);
});

test('counts dropped and missing batches', () => {
  const h = new Harness();
  h.joined();
  h.receive(server.poseBatch({tick: 1}, [{avatar: 1, x: 0}]),
            server.poseBatch({tick: 5}, [{avatar: 1, x: 0}]), server.lagging(3, 1),
            server.lagging(4, 1));
  const counted = h.session.statistics();
  assert.equal(counted.batchesMissing, 3);
  assert.equal(counted.batchesDropped, 4);
  assert.equal(counted.eventsDropped, 1);
  assert.equal(counted.posesReceived, 2);
});

test('avatars that cross a ring of a region stay visible, live and recorded', () => {
  const h = new Harness({poseHistory: 64});
  const world = h.joined();
  const listed: number[] = [];
  world.on('avatars', (avatars) => listed.push(avatars.length));
  // Each tick has one batch per mode. At tick 70, avatar 2 moves to the inner ring, and the outer
  // ring is empty from then on.
  for (let tick = 60; tick < 80; ++tick) {
    const crossed = tick >= 70;
    h.receive(server.poseBatch({tick, partial: true},
                               [{avatar: 1, x: 1}, ...(crossed ? [{avatar: 2, x: tick}] : [])]));
    if (!crossed) {
      h.receive(server.poseBatch({tick, partial: true, quantised: true}, [{avatar: 2, x: tick}]));
    }
  }
  assert.deepEqual([...new Set(listed)], [1, 2]);
  const live = createCrowdPose();
  const recorded = createCrowdPose();
  for (const tick of [60, 65, 69, 70, 75, 79]) {
    for (const [source, out] of [[world, live], [world.recording, recorded]] as const) {
      assert.equal(source.sampleAll(tick / 60, out), 2);
      assert.deepEqual([...out.avatars.subarray(0, 2)], [1, 2]);
      assert.deepEqual([out.rootsM[0], out.rootsM[3]], [1, tick]);
    }
  }
});
