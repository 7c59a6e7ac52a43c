import assert from 'node:assert/strict';
import {test} from 'node:test';
import {Session} from '../src/session';
import {defaultOptions} from '../src/session_options';
import type {PoseDetail, Region, Reply, Terrain} from '../src/types';
import * as server from './support/server_frames';
import {Harness, statusOf, summary} from './support/session_harness';

const region = (detail?: PoseDetail): Region => ({
  x: 1, z: 2, radiusM: 30,
  rings: [{outerRadiusM: 8, everyNTicks: 1, ...(detail === undefined ? {} : {detail})},
          {outerRadiusM: 20, everyNTicks: 2}],
});

test('rejects invalid arguments at once and names them', async () => {
  const h = new Harness();
  const world = h.joined();
  const bad: [Promise<Reply>, RegExp][] = [
    [world.spawn([]), /Spawn.items: expected 1 to/],
    [world.spawn([{positionM: [0, NaN, 0], headingRad: 0}]),
     /positionM\[0\]: expected a finite number, got NaN/],
    [world.spawn([{avatar: -1, positionM: [0, 0, 0], headingRad: 0}]), /avatar\[0\]/],
    [world.remove([0]), /Remove.avatars: expected a number/],
    [world.remove([1.5]), /avatars\[0\]/],
    [world.request([{avatar: 1, type: 'fly' as 'jump'}]), /type\[0\]: expected one of .*, got fly/],
    [world.request([{avatar: 1, type: 'step', lengthM: Infinity}]), /lengthM\[0\]/],
    [world.request([{avatar: 1, requestId: 2 ** 60, type: 'stand'}]), /requestId\[0\]/],
    [world.request([{avatar: 1, requestId: 0n, type: 'stand'}]),
     /requestId: expected a number other than 0/],
    [world.request(null as never), /items/],
    [world.observe({mode: 'compact' as 'full'}).reply, /mode/],
    [world.observe({mode: 'full', everyNTicks: 0}).reply, /everyNTicks/],
    [world.observe({mode: 'full', detail: 'root'}).reply, /detail/],
    [world.observe({mode: 'quantised', detail: 'some' as 'root'}).reply, /detail/],
    [world.observe({mode: 'full', region: region('all')}).reply, /region.ringDetails/],
    [world.observe({mode: 'quantised', region: region('some' as 'root')}).reply,
     /region.ringDetails\[0\]/],
  ];
  for (const [promise, why] of bad) {
    const reply = await promise;
    assert.equal(reply.status, 'invalid_argument');
    assert.match(reply.text, why);
  }
  assert.deepEqual(h.sent(), []);
  assert.equal(statusOf(await h.session.joinWorld('', 'observer').joined), 'invalid_argument');
  assert.equal(statusOf(await h.session.joinWorld('plaza', 'observer').joined), 'already_joined');
  const options = {...defaultOptions, seed: 1};
  assert.throws(() => new Session({...options, clientName: ''}, () => 0), TypeError);
  assert.throws(() => new Session({...options, poseHistory: 1}, () => 0), RangeError);
});

test('inspect returns the state of an avatar or rejects', async () => {
  const h = new Harness();
  const world = h.joined();
  const asked = world.inspect(41);
  const [first] = h.sent();
  assert.ok(first?.type === 'InspectAvatar' && first.avatar === 41 && first.world === 3);
  h.receive(server.avatarState(first.nonce, 41));
  assert.equal((await asked).movement, null);
  const none = world.inspect(42);
  const [second] = h.sent();
  assert.ok(second?.type === 'InspectAvatar');
  h.receive(server.avatarState(second.nonce, 42, 108));
  await assert.rejects(none, {code: 108, status: 'no_such_avatar'});
  const cut = world.inspect(41);
  h.lose();
  await assert.rejects(cut, {status: 'connection_lost'});
  await assert.rejects(world.inspect(41), {status: 'not_ready'});
});

test('terrain is the last one that the server sent', () => {
  const h = new Harness();
  const world = h.joined();
  const notified: (number[] | null)[] = [];
  world.on('terrain', (terrain) => notified.push(terrain?.boxes.map((box) => box.heightM) ?? null));
  const current = (): Terrain | null => world.terrain;
  assert.equal(current(), null);
  h.receive(server.worldTerrain(null));  // No change, so no notification.
  h.receive(server.worldTerrain([0.5, 0.25]), server.worldTerrain([1], 4));
  assert.deepEqual(current()?.boxes[1], {minM: [1, 0], maxM: [2, 1], heightM: 0.25});
  h.receive(server.worldTerrain([0.125]));
  h.receive(server.worldTerrain(null));
  h.receive(server.worldTerrain([2]));
  h.lose();
  assert.deepEqual(notified, [[0.5, 0.25], [0.125], null, [2]]);
  h.connect();  // A new session: the client waits for the server to send the terrain again.
  assert.equal(current(), null);
  assert.deepEqual(notified, [[0.5, 0.25], [0.125], null, [2], null]);
});

test('sends terrain and footprints unchanged', async () => {
  const h = new Harness();
  const world = h.joined();
  const heightField = {
    originM: [-1, 2] as const, cellM: 0.5, columns: 2, rows: 2,
    heightsM: Float32Array.of(0, 0.5, 1, 1.5),
  };
  const boxes = [{minM: [0, 0] as const, maxM: [1, 2] as const, heightM: 0.25}];
  const set = world.setTerrain({heightField, boxes});
  heightField.heightsM[0] = 9;  // The client has its own copy.
  const cleared = world.setTerrain(null);
  const stepped = world.request([
    {avatar: 1, type: 'step', foot: 'left', atM: [1, 0.25, -2], headingRad: 0, lengthM: 3},
    {avatar: 1, type: 'step', atM: [1, 0, 0]},
  ]);
  const [first, second, third] = h.sent();
  assert.ok(first?.type === 'SetTerrain' && second?.type === 'SetTerrain');
  assert.deepEqual(first.terrain, {
    heightField: {...heightField, heightsM: Float32Array.of(0, 0.5, 1, 1.5)}, boxes
  });
  assert.equal(second.terrain, null);
  assert.ok(third?.type === 'Request');
  assert.deepEqual(third.items.map(({atM, headingRad, lengthM}) => ({atM, headingRad, lengthM})), [
    {atM: [1, 0.25, -2], headingRad: 0, lengthM: 0},
    {atM: [1, 0, 0], headingRad: null, lengthM: 0},
  ]);
  h.receive(server.reply(3n), server.reply(4n), server.reply(5n));
  assert.deepEqual((await Promise.all([set, cleared, stepped])).map(statusOf), ['ok', 'ok', 'ok']);

  const bad = [
    {heightField: {...heightField, columns: 3}, boxes: []},
    {heightField: {...heightField, cellM: 0}, boxes: []},
    {heightField: {...heightField, heightsM: Float32Array.of(0, 1, 2, NaN)}, boxes: []},
    {heightField: null, boxes: [{minM: [0, 0] as const, maxM: [0, 1] as const, heightM: 0}]},
  ];
  for (const terrain of bad) {
    assert.equal((await world.setTerrain(terrain)).status, 'invalid_argument');
  }
  assert.equal((await world.request([{avatar: 1, type: 'step', atM: [1, 2, NaN]}])).status,
               'invalid_argument');
  assert.deepEqual(h.sent(), []);
});

test('sends a walk unchanged', async () => {
  const h = new Harness();
  const world = h.joined();
  void world.request([
    {avatar: 1, type: 'walk', atM: [3, 0, -5], headingRad: 0, waypointsM: [[1, 0, -2]],
     speedMPerS: 1.25},
    {avatar: 2, type: 'walk', atM: [1, 0, 0], headingRad: 1, lengthM: 3},
  ]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'Request');
  assert.deepEqual(
    sent.items.map(({type, atM, headingRad, waypointsM, speedMPerS}) =>
        [type, atM, headingRad, waypointsM, speedMPerS]),
    [['walk', [3, 0, -5], 0, [[1, 0, -2]], 1.25], ['walk', [1, 0, 0], 1, [], null]]);
  const goal = {avatar: 1, type: 'walk', atM: [0, 0, 1], headingRad: 0} as const;
  for (const bad of [
    {...goal, atM: undefined}, {...goal, headingRad: undefined}, {...goal, speedMPerS: NaN},
    {...goal, waypointsM: Array.from({length: 65}, () => [0, 0, 0] as const)},
  ]) {
    assert.equal((await world.request([bad as typeof goal])).status, 'invalid_argument');
  }
});

test('sends interrupts', async () => {
  const h = new Harness();
  const world = h.joined();
  const step = {avatar: 1, type: 'step', lengthM: 0.5} as const;
  void world.request([{...step, interrupt: 'now'}, {...step, interrupt: 'afterMovement'}, step]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'Request');
  assert.deepEqual(sent.items.map(({interrupt}) => interrupt), ['now', 'afterMovement', 'none']);
  assert.equal((await world.request([{...step, interrupt: 'soon'} as never])).status,
               'invalid_argument');
});

test('sends exactOnly and allowNearest', async () => {
  const h = new Harness();
  const world = h.joined();
  const step = {avatar: 1, type: 'step', atM: [1, 0, 2], exactOnly: true} as const;
  const plain = {avatar: 1, type: 'step', lengthM: 0.5} as const;
  void world.request([
    step, {...step, exactOnly: false}, {avatar: 1, type: 'step', atM: [1, 0, 2]},
    {...plain, exactOnly: true}, plain, {...plain, allowNearest: true},
    {...step, exactOnly: false, allowNearest: true}, {avatar: 1, type: 'jump', allowNearest: true},
    {avatar: 1, type: 'jump'}, {avatar: 1, type: 'stand'},
  ]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'Request');
  assert.deepEqual(sent.items.map(({exactOnly, allowNearest}) => [exactOnly, allowNearest]), [
    [true, false], [false, false], [false, false], [true, false], [false, false], [false, true],
    [false, true], [false, true], [false, false], [false, false],
  ]);
  for (const bad of [
    {...plain, allowNearest: 'yes'}, {avatar: 1, type: 'stand', allowNearest: true},
    {avatar: 1, type: 'walk', atM: [0, 0, 1], headingRad: 0, allowNearest: true},
  ]) {
    const reply = await world.request([bad as never]);
    assert.equal(reply.status, 'invalid_argument');
    assert.match(reply.text, /allowNearest/);
  }
  for (const bad of [
    {...step, allowNearest: true}, {...step, exactOnly: 1},
    {...step, type: 'walk', headingRad: 0}, {...step, type: 'jump'},
  ]) {
    const reply = await world.request([bad as never]);
    assert.equal(reply.status, 'invalid_argument');
    assert.match(reply.text, /exactOnly/);
  }
});

test('sends layers', async () => {
  const h = new Harness();
  const world = h.joined();
  void world.setLayers(
      [{avatar: 1, layer: 'wave'}, {avatar: 2, layer: 'carry', enabled: false, blendS: 0}]);
  const [sent] = h.sent();
  assert.ok(sent?.type === 'SetLayers');
  assert.deepEqual(sent.items, [
    {avatar: 1, layer: 'wave', enabled: true, weight: 1, blendS: 0.3, speed: 1},
    {avatar: 2, layer: 'carry', enabled: false, weight: 1, blendS: 0, speed: 1},
  ]);
  for (const wrong of [{avatar: 0, layer: 'wave'}, {avatar: 1, layer: ''}, {avatar: 1},
                       {avatar: 1, layer: 'wave', weight: NaN},
                       {avatar: 1, layer: 'wave', enabled: 0}]) {
    assert.equal((await world.setLayers([wrong as never])).status, 'invalid_argument');
  }
});

test('sends foot planting', async () => {
  const h = new Harness();
  const world = h.joined();
  void world.setPlanting([1, 7], false);
  void world.setPlanting([7], true);
  const sent = h.sent();
  assert.deepEqual(sent.map((m) => m.type === 'SetPlanting' && [[...m.avatars], m.enabled]),
                   [[[1, 7], false], [[7], true]]);
  for (const [avatars, enabled] of [[[], true], [[0], true], [[1], 1]]) {
    const reply = await world.setPlanting(avatars as never, enabled as never);
    assert.equal(reply.status, 'invalid_argument');
  }
});

test('sends the detail of an observation', async () => {
  const h = new Harness();
  const world = h.joined();
  void world.observe({mode: 'quantised', detail: 'reduced'});
  assert.deepEqual(h.sent().map((m) => m.type === 'Observe' && m.detail), ['reduced']);
});

test('sends the detail of each ring of a region', async () => {
  const h = new Harness();
  h.connect();
  const world = h.session.joinWorld('plaza', 'observer');
  h.sent();
  h.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  const details = (): unknown =>
      h.sent().map((m) => m.type === 'Observe' && [m.detail, m.region?.ringDetails]);
  const observed = world.observe(
      {mode: 'quantised', detail: 'root', everyNTicks: 4, region: region('reduced')});
  assert.deepEqual(details(), [['root', ['reduced', 'root']]]);
  h.receive(server.reply(2n));
  void observed.moveRegion(region());
  assert.deepEqual(details(), [['root', []]]);
  void observed.moveRegion(region('all'));
  assert.deepEqual(details(), [['root', ['all', 'root']]]);
  const {text} = await observed.moveRegion(region('none' as 'all'));
  assert.match(text, /region.ringDetails\[0\]/);
});

test('moves the region of an observation that has not been sent', async () => {
  const h = new Harness();
  const world = h.session.joinWorld('plaza', 'observer');
  const observed = world.observe({mode: 'quantised', region: region()});
  assert.ok((await observed.moveRegion({...region(), x: 5})).ok);
  assert.match((await observed.moveRegion({...region(), x: NaN})).text, /region.centreM/);
  h.connect();
  h.receive(server.worldInfo(1n, 3, 'plaza'), server.reply(1n));
  const sent = h.sent().filter((m) => m.type === 'Observe');
  assert.deepEqual(sent.map((m) => m.region?.centreM[0]), [5]);
});
