// Avatars are sent to places by clicks on the ground, over level ground and hills, and the page shows where to
// until they are there, or says why they go no further.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {Client} from '@stridewire/client';
import WebSocket from 'ws';

import {launch} from '../browser.mjs';
import {Proxy, Server, cameraRests, figuresShown, framesDrawn, keep, openPage, until} from './support.mjs';

let server;
let client;
let browser;

before(async () => {
  server = await Server.start();
  client = new Client({url: `ws://127.0.0.1:${server.httpPort}/stream`, webSocket: WebSocket});
  client.connect();
  browser = await launch();
});

after(async () => {
  await browser?.close();
  client?.close();
  await server?.kill();
});

/** A page with one avatar, chosen, and the tool that sends it taken up; seen from above. */
async function openWorld(name, options = {}, port = server.httpPort) {
  const heard = [];
  const world = client.joinWorld(name);
  world.on('event', (event) => heard.push(event));
  const {page, context, errors} = await openPage(
    browser, port, `world=${name}&quality=low&figures=bodies`, {hasTouch: true, ...options});
  const look = (f, argument) => page.evaluate(f, argument);
  const eventually = (what, f, argument) => until(what, () => page.evaluate(f, argument));
  const key = (letter) => page.locator('canvas.scene').press(letter);
  await eventually('the page is there', () => window.stridewire?.worlds[0]?.world.skeleton);
  await key('b');
  const avatar = await eventually('it is chosen and inspected', () =>
    window.stridewire.inspected && window.stridewire.selection?.avatar);
  await key('m');
  for (let i = 0; i < 8; ++i) await key('ArrowUp');
  /** All of it in view, and so much more around. */
  const frameAll = async (times) => {
    await key('f');
    await framesDrawn(page, 2);  // A key more would be instead of it.
    for (let i = 0; i < times; ++i) await key('-');
    await cameraRests(page);
  };
  await figuresShown(page);
  await frameAll(3);
  /** Where a place is on the page, beside the panels. */
  const onPage = async (x, z) => {
    const {at, free} = await look(([a, b]) => {
      const {view} = window.stridewire.worlds[0];
      return {at: view.onPage([a, view.ground.heightAt(a, b), b]), free: {...view.free}};
    }, [x, z]);
    assert.ok(at.x > free.x && at.x < free.x + free.width && at.y > free.y && at.y < free.y + free.height,
      `${x}, ${z} is not to be clicked: ${JSON.stringify({at, free})}`);
    return at;
  };
  const marked = (goals) => eventually(`${goals} goals are marked`, (n) =>
    window.stridewire.sampled()[0].goals === n, goals);
  const message = () => page.locator('.message').textContent();
  const said = async (text) => {
    let last = '';
    await until(`it is said: ${text}`, async () => (last = await message()).includes(text), 30).catch((error) => {
      throw new Error(`${error.message}, not: ${last}`);
    });
  };
  /** As the page tells what is so at that time or later. */
  const rests = (timeS = 0) => eventually('it stands', (t) => {
    const {inspected} = window.stridewire;
    return inspected.timeS >= t && inspected.movement === null && inspected.queueSize === 0 ? inspected : null;
  }, timeS);
  /** A walk that `act` asks for, as the server has it. */
  const walk = async (act) => {
    const from = heard.length;
    await act();
    const {requestId} = await until('it is accepted', () => heard.slice(from).find(
      (event) => event.type === 'accepted' && event.avatar === avatar));
    const item = await until('it is queued', async () => (await world.inspect(avatar)).queue.find(
      (queued) => queued.requestId === requestId));
    assert.equal(item.type, 'walk');
    return item;
  };
  /** It stands where it was sent, to 1 cm and a degree, and nothing is marked any more. */
  const arrives = async ({atM, headingRad, requestId}) => {
    const {timeS} = await until('it arrives', () => heard.find(
      (event) => event.requestId === requestId && event.type === 'finished' && event.kind === 'stand'));
    await said(`Avatar ${avatar} has arrived.`);
    await marked(0);
    const {basePositionM: base, baseHeadingRad} = await rests(timeS);
    assert.ok(Math.hypot(base[0] - atM[0], base[2] - atM[2]) < 0.01, `${base}, not ${atM}`);
    const turn = baseHeadingRad - headingRad;
    assert.ok(Math.abs(Math.atan2(Math.sin(turn), Math.cos(turn))) < Math.PI / 180, `${turn}`);
    return base;
  };
  const near = (atM, x, z) => assert.ok(Math.hypot(atM[0] - x, atM[2] - z) < 0.05, `${atM}, not ${x}, ${z}`);
  return {
    heard, world, page, context, errors, avatar, frameAll, look, eventually, key, onPage, marked, said, rests, walk, arrives,
    near};
}

test('a click on level ground brings the avatar there', async () => {
  const {page, context, errors, look, onPage, marked, walk, arrives, near} = await openWorld('level');
  const goal = await onPage(1.1, 1.4);
  const item = await walk(() => page.mouse.click(goal.x, goal.y));
  near(item.atM, 1.1, 1.4);
  await marked(1);
  await keep(page, 'walk_level');
  await arrives(item);

  // By a finger, and by the keyboard alone.
  const back = await onPage(0.2, 0.1);
  const second = await walk(() => page.touchscreen.tap(back.x, back.y));
  near(second.atM, 0.2, 0.1);
  await arrives(second);
  const third = await walk(async () => {
    await page.locator('#walk-x').focus();
    for (const value of ['-0.75', '0.5', '-90']) {
      await page.keyboard.press('Control+A');
      await page.keyboard.type(value);
      await page.keyboard.press('Tab');
    }
    await page.keyboard.press('Tab');
    await page.keyboard.press('Enter');
  });
  assert.deepEqual(third.atM, [-0.75, 0, 0.5]);
  assert.ok(Math.abs(third.headingRad + Math.PI / 2) < 1e-9);
  await arrives(third);

  // There is nothing to click where the server knows no walks.
  const offered = () => page.locator('#drive-walk, #walk-x').evaluateAll(
    (elements) => elements.filter((element) => element.checkVisibility()).length);
  assert.equal(await offered(), 2);
  await look(() => {
    const {client} = window.stridewire;
    client.serverHas = (feature) => feature !== 'walks' && Object.getPrototypeOf(client).serverHas.call(client, feature);
  });
  await until('walks are not offered', async () => await offered() === 0);
  assert.equal(await page.locator('#drive-place').isVisible(), true);
  assert.equal(await look(() => document.querySelector('canvas.scene').classList.contains('placing')), false);
  assert.deepEqual(errors, []);
  await context.close();
});

test('a click on hills brings the avatar there, seen from any side', async () => {
  const {page, context, errors, eventually, frameAll, key, look, onPage, marked, walk, arrives, near} =
    await openWorld('hilly', {colorScheme: 'dark'});
  await page.locator('#drive-ground').selectOption('hills');
  await eventually('there are hills', () => !window.stridewire.worlds[0].view.ground.flat);
  for (const [x, z] of [[1.6, 1.3], [-0.4, 1.8]]) {
    for (let i = 0; i < 6; ++i) await key('ArrowLeft');
    await frameAll(5);
    const goal = await onPage(x, z);
    const item = await walk(() => page.mouse.click(goal.x, goal.y));
    near(item.atM, x, z);
    await marked(1);
    await keep(page, 'walk_hills');
    const base = await arrives(item);
    const height = await look(([a, , b]) => window.stridewire.worlds[0].view.ground.heightAt(a, b), base);
    assert.ok(height > 0.05 && Math.abs(base[1] - height) < 0.1, `${base[1]} on ground of ${height} m`);
  }
  assert.deepEqual(errors, []);
  await context.close();
});

test('a new goal mid-way counts from the next step on', async () => {
  const {heard, page, context, errors, world, avatar, onPage, marked, walk, arrives, near} =
    await openWorld('midway');
  const far = await onPage(1.4, 1.6);
  const first = await walk(() => page.mouse.click(far.x, far.y));
  await until('it is on its way', () => heard.filter((event) => event.requestId === first.requestId &&
    event.type === 'started').length >= 2);
  const other = await onPage(-1.2, 0.9);
  const second = await walk(() => page.mouse.click(other.x, other.y));
  near(second.atM, -1.2, 0.9);
  // The first one is no more; only the step under way is finished.
  await marked(1);
  assert.ok((await world.inspect(avatar)).queue.every(({requestId}) => requestId !== first.requestId));
  await arrives(second);
  const taken = heard.findIndex(({type, requestId}) => type === 'accepted' && requestId === second.requestId);
  const late = heard.slice(taken).filter(({requestId}) => requestId === first.requestId);
  assert.deepEqual(late.filter(({type}) => type !== 'footStrike' && type !== 'finished'), []);
  assert.ok(late.filter(({type}) => type === 'finished').length <= 1);
  assert.deepEqual(errors, []);
  await context.close();
});

test('a goal that can not be reached says why', async () => {
  const {heard, world, page, context, errors, avatar, eventually, onPage, marked, rests} =
    await openWorld('walled');
  const box = {minM: [-2, 0.8], maxM: [2, 2.8], heightM: 0.2};
  assert.ok((await world.setTerrain({heightField: null, boxes: [box]})).ok);
  await eventually('the block is there', () => !window.stridewire.worlds[0].view.ground.flat);
  for (const closed of [false, true]) {
    // Where the panel is closed it is said over the scene.
    if (closed) await page.getByRole('button', {name: 'Close Drive', exact: true}).click();
    await cameraRests(page);
    // Nobody can stand on an edge.
    const goal = await onPage(0.1, 0.83);
    const from = heard.length;
    await page.mouse.click(goal.x, goal.y);
    const {reason} = await until('it is rejected', () => heard.slice(from).find(
      (event) => event.type === 'rejected' && event.avatar === avatar));
    assert.match(reason, /edge/);
    const [where, other] = closed ? ['.toast', '.message'] : ['.message', '.toast'];
    await until('that is said', async () => await page.locator(where).isVisible() &&
      await page.locator(where).textContent() === `Avatar ${avatar} goes no further: ${reason}.`);
    assert.equal(await page.locator(other).isVisible(), false);
    await keep(page, closed ? 'walk_refused_toast' : 'walk_refused');
    await marked(0);
    await rests();
  }
  assert.deepEqual(errors, []);
  await context.close();
});

test('where a foot is asked to is marked until it is there', async () => {
  const {heard, page, context, errors, avatar, look, eventually, key, onPage, rests} = await openWorld('feet');
  await key('t');
  // It begins at once, so nothing waits in the queue. A step is short: every frame is looked at, and on a machine
  // that is too slow to show one, another is asked for.
  await look(() => {
    window.markedUnderWay = false;
    const each = () => {
      const {inspected} = window.stridewire;
      window.markedUnderWay ||= inspected !== null && inspected.movement !== null && inspected.queueSize === 0 &&
        window.stridewire.sampled()[0].planned === 1;
      requestAnimationFrame(each);
    };
    each();
  });
  let x = 0.25;
  await until('it is marked', async () => {
    const goal = await onPage(x, 0.35);
    const from = heard.length;
    await page.mouse.click(goal.x, goal.y);
    const strike = await until('a foot lands', () => heard.slice(from).find(
      (event) => event.type === 'footStrike' && event.avatar === avatar && event.requestId !== 0n));
    assert.ok(Math.hypot(strike.positionM[0] - x, strike.positionM[2] - 0.35) < 0.03, `${strike.positionM}`);
    await eventually('the mark is gone', () => window.stridewire.sampled()[0].planned === 0);
    await rests();
    x = -x;
    return look(() => window.markedUnderWay);
  });
  assert.deepEqual(errors, []);
  await context.close();
});

test('a goal is shown again, and its end told, after the connection was cut', async () => {
  const proxy = await Proxy.start(server.httpPort);
  const {page, context, look, eventually, marked, said} = await openWorld('cut', {}, proxy.port);
  await look(() => {
    window.markedAlone = false;
    const each = () => {
      const {client} = window.stridewire;
      window.markedAlone ||= client.state !== 'ready' && window.stridewire.sampled()[0].goals > 0;
      requestAnimationFrame(each);
    };
    each();
  });
  await page.locator('#walk-x').fill('3');
  await page.locator('#walk-x').press('Enter');
  await marked(1);
  proxy.cut();
  await eventually('the session goes on', () => window.stridewire.client.statistics.resumes === 1);
  await said('has arrived.');
  await marked(0);
  assert.equal(await look(() => window.markedAlone), false);
  await context.close();
  proxy.stop();
});

test('marks go when the walk is given up, its avatar leaves, or the server', async () => {
  const {page, context, key, eventually, look, onPage, marked, rests, walk} = await openWorld('ended');
  const far = await onPage(1.2, 1.5);
  await walk(() => page.mouse.click(far.x, far.y));
  await marked(1);
  await key('x');
  await marked(0);
  await rests();

  const back = await onPage(0, 0);
  await walk(() => page.mouse.click(back.x, back.y));
  await marked(1);
  await key('Delete');
  await marked(0);
  await eventually('it is gone', () => window.stridewire.worlds[0].world.avatars().length === 0);

  await key('b');
  await eventually('another is chosen', () => window.stridewire.selection !== null);
  await key('m');
  await key('m');
  await page.locator('#walk-x').fill('40');
  await page.locator('#walk-x').press('Enter');
  await marked(1);
  await server.kill();
  await marked(0);
  assert.notEqual(await look(() => window.stridewire.client.state), 'ready');
  await context.close();
});
