// Every control of the page does what its label says. What there is comes from the page itself: one without a
// check here fails, and so does a check of one that is gone.

import assert from 'node:assert/strict';
import {after, before, test} from 'node:test';

import {Client, createPose} from '@stridewire/client';
import WebSocket from 'ws';

import {launch} from '../browser.mjs';
import {Server, cameraRests, differing, framesDrawn, keep, openPage, tell, until} from './support.mjs';

let server;
let client;
let alpha;
let browser;

before(async () => {
  server = await Server.start();
  // Looks over the page's shoulder, and makes a second world.
  client = new Client({url: `ws://127.0.0.1:${server.httpPort}/stream`, webSocket: WebSocket});
  client.connect();
  alpha = client.joinWorld('alpha');
  const beta = client.joinWorld('beta');
  assert.ok((await beta.spawn([{avatar: 1, positionM: [0, 0, 0], headingRad: 0}])).ok);
  browser = await launch();
});

after(async () => {
  await browser?.close();
  client?.close();
  await server?.kill();
});

/** Names of all controls there are now: where, and what they are called. */
const controlsOf = (page) => page.evaluate(() => [...document.querySelectorAll(
  'button, input, select, summary, a[href], textarea, [role=application]')].map((element) => {
  const where = element.closest('section')?.id.replace('panel-', '') ??
    (element.closest('dialog') ? 'help' : element.closest('.card') ? 'card' :
      element.closest('.transport') ? 'playback' : 'page');
  if (element.classList.contains('chip')) return 'page: a world';
  const label = element.tagName === 'CANVAS' ? 'the scene' : element.id ||
    element.getAttribute('aria-label') || element.textContent;
  return `${where}: ${label.replace(/^Stop wandering.*/, 'Let them wander').replace(/^Play$/, 'Pause')
    .replace(/^(Dark|Light)$/, 'Dark or light').replace(/^\d+ joints$/, 'Joints')}`;
}));

test('every control does what its label says', async () => {
  const {page, context, errors} = await openPage(browser, server.httpPort, 'world=alpha&figures=bodies',
    // As small as it may be with panels beside the scene.
    {hasTouch: true, viewport: {width: 920, height: 540}});
  const devtools = await context.newCDPSession(page);
  await until('the page is there', () => page.evaluate(
    () => window.stridewire?.worlds[0]?.world.skeleton));
  const look = (f, argument) => page.evaluate(f, argument);
  const eventually = (what, f, argument) => until(what, () => page.evaluate(f, argument));
  const press = (name, where = 'body') =>
    page.locator(where).getByRole('button', {name, exact: true}).click();
  const inDrive = (name) => press(name, '#panel-drive');
  const key = (name) => page.locator('canvas.scene').press(name);
  const slide = (id, value) => page.locator(`#${id}`).fill(String(value));
  const avatars = () => look(() => [...window.stridewire.worlds[0].world.avatars()]);
  const frames = (count) => framesDrawn(page, count);
  const live = () => eventually('it is live', () => window.stridewire.playback.live);
  const picture = async () => {
    await frames(2);
    return page.screenshot({clip: await look(() => {
      const {x, y, width, height} = window.stridewire.worlds[0].view.free;
      return {x: Math.ceil(x), y: Math.ceil(y), width: Math.floor(width), height: Math.floor(height)};
    })});
  };
  /** Nothing changes between pictures because a frame took long. */
  const holdQuality = async () => {
    await look(() => window.stridewire.app.appearance.chooseQuality('low'));
    await frames(2);
  };
  const letQualityGo = () => look(() => window.stridewire.app.appearance.chooseQuality('auto'));
  /** Of what no panel covers. */
  const middle = async () => {
    // What panels leave of the scene is known with the next frame.
    await frames(2);
    const {onScene, ...at} = await look(() => {
      const {x, y, width, height} = window.stridewire.worlds[0].view.free;
      const at = {x: x + width / 2, y: y + height / 2};
      return {...at, onScene: document.elementFromPoint(at.x, at.y)?.matches('canvas.scene')};
    });
    assert.ok(onScene, `something lies over the scene at ${JSON.stringify(at)}`);
    return at;
  };
  const orbit = () => look(() => {
    const {wantAzimuth, wantElevation, wantDistance} = window.stridewire.app.camera.orbit;
    return {wantAzimuth, wantElevation, wantDistance};
  });
  const target = () => look(() => window.stridewire.worlds[0].view.view.want.toArray());
  const following = () => look(() => window.stridewire.worlds[0].view.following);
  const wandering = (n) => eventually(`${n} wander`, (count) =>
    (window.stridewire.worlds[0] && window.stridewire.app.shown[0].wander?.size) === count, n);

  let driven = 0;
  /** What the server has queued last for the driven avatar, once there are `size`. */
  const queued = async (size) => {
    const state = await until(`${size} are queued`, async () => {
      const now = await alpha.inspect(driven);
      return now.queueSize === size ? now : null;
    });
    return state.queue[size - 1];
  };
  const pauseS = 2;
  /** Alone and busy, so that what follows stays in its queue. */
  const busy = async () => {
    await alpha.cancel([driven]);
    await until('it is busy', async () => {
      const {movement, queueSize} = await alpha.inspect(driven);
      if (movement !== null && queueSize >= 10) return true;
      await alpha.request(Array.from(
        {length: 12 - queueSize}, () => ({avatar: driven, type: 'stand', seconds: pauseS})));
      return false;
    });
  };
  /** `act` adds one item to the queue. */
  const adds = async (act) => {
    await busy();
    const {queueSize} = await alpha.inspect(driven);
    await act();
    // One of those before it may have begun meanwhile.
    return until('it is queued', async () => {
      const {queue} = await alpha.inspect(driven);
      const last = queue.at(-1);
      return last && !(last.type === 'stand' && last.seconds === pauseS) && queue.length <= queueSize + 1 ?
        last : null;
    });
  };
  const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-4, `${a}, not ${b}`);
  const queueIsEmpty = async (act) => {
    await busy();
    await act();
    await until('the queue is empty', async () => (await alpha.inspect(driven)).queueSize === 0);
  };
  /** Does nothing, and is drawn so. */
  const stands = async () => {
    await alpha.cancel([driven]);
    const {timeS} = await until('it stands', async () => {
      const state = await alpha.inspect(driven);
      return state.movement === null && state.queueSize === 0 ? state : null;
    });
    await eventually('that is seen', (t) => window.stridewire.sampled()[0].timeS > t + 0.5, timeS);
  };
  /** A layer of the driven avatar begins and ends with its button: the right arm tells. */
  const layers = async (layer) => {
    await stands();
    const subscription = alpha.observe({mode: 'full', avatars: [driven]});
    const pose = createPose();
    const joint = alpha.skeleton.names.indexOf('RightArm');
    const arm = () => until('a pose of it has come', () => {
      const timeS = client.renderTimeS();
      return timeS !== null && alpha.sample(driven, timeS, pose) !== 'missing' &&
        [...pose.rotations.subarray(4 * joint, 4 * joint + 4)];
    });
    const hangs = await arm();
    const isUp = async () => {
      const now = await arm();
      return Math.abs(now.reduce((sum, x, i) => sum + x * hangs[i], 0)) < 0.99;
    };
    const toggle = page.locator(`#drive-layer-${layer}`);
    for (const on of [true, false]) {
      await toggle.click();
      await until(`it is ${on ? 'on' : 'off'}`, async () =>
        await isUp() === on && await toggle.getAttribute('aria-pressed') === String(on));
    }
    await subscription.stop();
  };
  /** Feet are planted no more, and are again; the button shows what others do, too. */
  const plants = async (act) => {
    const is = (on) => until(`feet are planted: ${on}`, async () =>
      (await alpha.inspect(driven)).plantingOff === !on && await pressed('drive-planting') === on);
    await is(true);
    for (const on of [false, true]) {
      await act();
      await is(on);
    }
    for (const on of [false, true]) {
      assert.ok((await alpha.setPlanting([driven], on)).ok);
      await is(on);
    }
  };
  const spawns = async (act) => {
    const before = await avatars();
    await act();
    await eventually('there is one more', (n) =>
      window.stridewire.worlds[0].world.avatars().length === n, before.length + 1);
    driven = (await avatars()).find((avatar) => !before.includes(avatar));
    await eventually('it is chosen and drawn', (n) => window.stridewire.selection?.avatar === n &&
      window.stridewire.sampled()[0].avatars.includes(n), driven);
  };
  const removes = async (act) => {
    await act();
    await eventually('it is gone', (n) =>
      !window.stridewire.worlds[0].world.avatars().includes(n), driven);
  };
  const follows = async (act) => {
    await act();
    assert.equal(await following(), driven);
    await act();
    assert.equal(await following(), 0);
  };
  const wanders = async (act, count) => {
    await act();
    await wandering(count);
    await until('one walks', async () => (await alpha.inspect(driven)).movement?.requestId);
    await act();
    await wandering(0);
    await alpha.cancel([driven]);
  };
  const frameAll = async (act) => {
    await key('+');
    await act();
    await until('the button shows it', async () =>
      await page.getByRole('button', {name: 'Frame all'}).getAttribute('aria-pressed') === 'true');
    await frames(1);
    const framed = (await orbit()).wantDistance;
    const {x, y} = await middle();
    await page.mouse.move(x, y);
    await page.mouse.wheel(0, 600);
    await until('it is out', async () => (await orbit()).wantDistance > framed);
    await act();
    await until('all are framed', async () => Math.abs((await orbit()).wantDistance - framed) < 0.5);
  };
  const pauses = async (act) => {
    await act();
    await eventually('it is paused', () => window.stridewire.playback.paused);
    const at = (await look(() => window.stridewire.sampled()))[0].timeS;
    await frames(3);
    assert.ok((await look(() => window.stridewire.sampled()))[0].timeS - at < 1e-6);
    await act();
    await until('it goes on', async () => (await look(() => window.stridewire.sampled()))[0].timeS > at);
  };
  const goesLive = async (act) => {
    await look(() => window.stridewire.playback.pause());
    await act();
    await live();
  };
  const steps = () => alpha.request(
    Array.from({length: 12}, () => ({avatar: driven, type: 'step', lengthM: 0.6})));
  /** Held in the middle of a step with parameters to look at. */
  const stepping = () => until('a step is held', async () => {
    await look(() => window.stridewire.playback.goLive());
    if ((await alpha.inspect(driven)).queueSize < 4) await steps();
    await eventually('a step is inspected', () =>
      window.stridewire.inspected?.movement?.sites.length > 0);
    await look(() => window.stridewire.playback.pause());
    await frames(3);
    return look(() => window.stridewire.inspected?.movement?.parameterNames.length >= 2 &&
      document.querySelectorAll('.scatter .site').length > 1);
  });
  const toggles = async (name) => {
    const shown = () => page.locator(`#panel-${name.toLowerCase()}`).isVisible();
    const button = page.locator('nav.tools').getByRole('button', {name, exact: true});
    const was = await shown();
    for (const open of [!was, was]) {
      await button.click();
      assert.equal(await shown(), open, `${name} ${open}`);
      assert.equal(await button.getAttribute('aria-expanded'), String(open));
    }
    return shown;
  };
  const opened = async (name) => {
    if (await page.locator(`#panel-${name.toLowerCase()}`).isVisible()) return;
    await page.locator('nav.tools').getByRole('button', {name, exact: true}).click();
  };
  const closes = async (name) => {
    await opened(name);
    await press(`Close ${name}`);
    assert.equal(await page.locator(`#panel-${name.toLowerCase()}`).isVisible(), false);
  };
  /** A box that shows something which the picture then has. */
  const shows = async (id) => {
    await opened('View');
    await holdQuality();
    const box = page.locator(`#${id}`);
    await box.check();
    await cameraRests(page);
    await until(`the picture tells ${id}`, async () => {
      const on = await picture();
      await box.uncheck();
      const shown = differing(on, await picture());
      await box.check();
      return shown > 2e-5 && differing(on, await picture()) < shown / 2;
    });
    await letQualityGo();
  };
  const bytesAPose = async () => {
    const count = () => look(() => {
      const {bytesReceived, posesReceived} = window.stridewire.client.statistics;
      return {bytes: bytesReceived, poses: posesReceived};
    });
    const from = await count();
    const to = await until('poses came', async () => {
      const now = await count();
      return now.poses >= from.poses + 30 ? now : null;
    });
    return (to.bytes - from.bytes) / (to.poses - from.poses);
  };
  /** What the table says of a stream, the one that is on where `now`. */
  const costOf = (name, now = false) => until(`it is told what ${name} costs`, () => look(([wanted, isNow]) => {
    const row = [...document.querySelectorAll('.costs tbody tr')].find((each) =>
      each.querySelector('th').textContent === wanted && (!isNow || each.getAttribute('aria-current') === 'true'));
    return row ? window.stridewire.app.streamCosts.costs.find((cost) => cost.name === wanted) : null;
  }, [name, now]));
  const figureAt = () => until('it can be clicked', () => look((number) => {
    const {view} = window.stridewire.worlds[0];
    const {x, y, width, height} = view.free;
    for (let row = y + 4; row < y + height; row += 6) {
      for (let column = x + 4; column < x + width; column += 6) {
        if (view.pick(column, row, 4) === number) return {x: column, y: row};
      }
    }
    return null;
  }, driven));
  const chosen = () => look(() => window.stridewire.selection?.avatar ?? 0);
  const drawsOthers = async (label) => {
    const select = page.getByLabel(label);
    const drawn = new Set();
    for (let k = 0; k < await select.locator('option').count(); ++k) {
      await select.selectOption(String(k));
      drawn.add(await look(() => document.querySelector('.scatter').innerHTML));
    }
    assert.ok(drawn.size > 1, [...drawn].join(' '));
  };

  const pressed = async (id) => await page.locator(`#${id}`).getAttribute('aria-pressed') === 'true';
  /** Places on level ground so far from the driven avatar along x and z, and where they are on the page. */
  const beside = (...offsets) => look(([number, all]) => {
    const {view} = window.stridewire.worlds[0];
    const {x, z} = view.place(number);
    return all.map(([dx, dz]) => {
      const at = [x + dx, 0, z + dz];
      return {at, ...view.onPage(at)};
    });
  }, [driven, offsets]);
  /** A click on the ground asks for a foot there while `toggle` has it so. */
  const places = async (toggle) => {
    await cameraRests(page);
    await toggle();
    assert.ok(await pressed('drive-place'));
    const [wanted] = await beside([0.35, 0.3]);
    const item = await adds(() => page.mouse.click(wanted.x, wanted.y));
    assert.equal(item.type, 'step');
    item.atM.forEach((v, k) => assert.ok(Math.abs(v - wanted.at[k]) < 0.03, `${item.atM}, not ${wanted.at}`));
    assert.equal(await chosen(), driven);
    await eventually('it is marked', () => window.stridewire.sampled()[0].planned === 1);
    await toggle();
    assert.equal(await pressed('drive-place'), false);
    await alpha.cancel([driven]);
    await eventually('the mark is gone', () => window.stridewire.sampled()[0].planned === 0);
  };
  const toGo = (goals, waypoints) => eventually(`${goals} goals and ${waypoints} places to pass are marked`,
    (wanted) => {
      const shown = window.stridewire.sampled()[0];
      return shown.goals === wanted.goals && shown.waypoints === wanted.waypoints;
    }, {goals, waypoints});
  /** What `act` sends the driven avatar to, once that is marked; then somebody else cancels it. */
  const goes = async (act, waypoints = 0) => {
    const item = await adds(act);
    assert.equal(item.type, 'walk');
    assert.equal(item.waypointsM.length, waypoints);
    await toGo(1, waypoints);
    assert.equal(await chosen(), driven);
    await alpha.cancel([driven]);
    await toGo(0, 0);
    return item;
  };
  const closeTo = (at, wanted) => at.forEach(
    (v, k) => assert.ok(Math.abs(v - wanted[k]) < 0.03, `${at}, not ${wanted}`));
  /** A click on the ground sends it there while `toggle` has it so. */
  const sends = async (toggle) => {
    await cameraRests(page);
    await toggle();
    assert.ok(await pressed('drive-walk') && !await pressed('drive-place'));
    const [wanted] = await beside([0.5, 0.4]);
    closeTo((await goes(() => page.mouse.click(wanted.x, wanted.y))).atM, wanted.at);
    // One of the two tools at a time.
    await page.locator('#drive-place').click();
    assert.ok(await pressed('drive-place') && !await pressed('drive-walk'));
    await toggle();
    assert.ok(await pressed('drive-walk') && !await pressed('drive-place'));
    await toggle();
    assert.equal(await pressed('drive-walk') || await pressed('drive-place'), false);
  };
  const walkTo = async (id, value) => {
    await page.locator(`#${id}`).fill(String(value));
    return goes(() => inDrive('Walk there'));
  };

  const everyone = 8;
  const checks = [
    ['card: Let them wander', async () => {
      await press('Let them wander', '.card');
      await eventually('all are there', (n) =>
        window.stridewire.worlds[0].world.avatars().length === n, everyone);
      await wandering(everyone);
      driven = (await avatars())[0];
      await until('one walks', async () => (await alpha.inspect(driven)).movement?.requestId);
      await until('the card is gone', async () => !await page.locator('.card').isVisible());
    }],
    ['drive: Let them wander', async () => {
      await page.locator('#panel-drive button.wide').click();
      await wandering(0);
      await wanders(() => page.locator('#panel-drive button.wide').click(), everyone);
    }],
    ['drive: drive-all', async () => {
      await page.locator('#drive-all').check();
      await eventually('all are addressed', (n) =>
        document.querySelector('.target').textContent === `All ${n} avatars of alpha`, everyone);
    }],
    ['drive: Remove', async () => {
      await inDrive('Remove');
      await eventually('all are gone', () => window.stridewire.worlds[0].world.avatars().length === 0);
      await page.locator('#drive-all').uncheck();
    }],
    ['drive: Spawn', () => spawns(() => inDrive('Spawn'))],
    ['drive: step-length', async () => {
      await slide('step-length', 0.5);
      near((await adds(() => inDrive('Step'))).lengthM, 0.5);
    }],
    ['drive: turn', async () => {
      await slide('turn', 20);
      near((await adds(() => inDrive('Step'))).turnRad, 20 * Math.PI / 180);
      await slide('turn', 0);
    }],
    ['drive: Step', async () => {
      const {type, foot} = await adds(() => inDrive('Step'));
      assert.deepEqual([type, foot], ['step', 'auto']);
    }],
    ['drive: Left foot', async () => {
      const {type, foot} = await adds(() => inDrive('Left foot'));
      assert.deepEqual([type, foot], ['step', 'left']);
    }],
    ['drive: Right foot', async () => {
      const {type, foot} = await adds(() => inDrive('Right foot'));
      assert.deepEqual([type, foot], ['step', 'right']);
    }],
    ['drive: jump-length', async () => {
      await slide('jump-length', 1.2);
      near((await adds(() => inDrive('Jump'))).lengthM, 1.2);
    }],
    ['drive: Jump', async () => assert.equal((await adds(() => inDrive('Jump'))).type, 'jump')],
    ['drive: stand-seconds', async () => {
      await slide('stand-seconds', 2.5);
      near((await adds(() => inDrive('Stand'))).seconds, 2.5);
    }],
    ['drive: Stand', async () => assert.equal((await adds(() => inDrive('Stand'))).type, 'stand')],
    ['drive: Clear queue', () => queueIsEmpty(() => inDrive('Clear queue'))],
    ['drive: drive-place', () => places(() => page.locator('#drive-place').click())],
    ['drive: drive-must', async () => {
      assert.equal(await page.locator('#drive-must').isVisible(), false);
      await stands();
      await cameraRests(page);
      await page.locator('#drive-place').click();
      await page.locator('#drive-must').check();
      const planned = (n) => eventually(`${n} prints are outlined`, (count) =>
        window.stridewire.sampled()[0].planned === count, n);
      const rejected = [];
      const off = alpha.on('event', (event) => event.type === 'rejected' && rejected.push(event));
      // Half a metre to the side and further on than any step: it stays, and what it reaches is outlined.
      const [far] = await beside([0.2, 1.6]);
      await page.mouse.click(far.x, far.y);
      await until('it is refused', () => rejected.length === 1);
      off();
      const {avatar, positionM, reason} = rejected[0];
      assert.equal(avatar, driven);
      assert.match(reason, /out of reach/);
      assert.ok(Math.hypot(positionM[0] - far.at[0], positionM[2] - far.at[2]) > 0.2, `${positionM}`);
      await planned(1);
      await page.locator('#drive-must').uncheck();
      await page.locator('#drive-place').click();
      await planned(0);
      // A walk shows where its foot lands next.
      const {basePositionM: [x, , z]} = await alpha.inspect(driven);
      await alpha.request([{avatar: driven, type: 'walk', atM: [x, 0, z + 2], headingRad: 0}]);
      await planned(1);
      await stands();
      await planned(0);
    }],
    ['drive: drive-walk', () => sends(() => page.locator('#drive-walk').click())],
    ['drive: walk-x', async () => near((await walkTo('walk-x', -1.25)).atM[0], -1.25)],
    ['drive: walk-z', async () => near((await walkTo('walk-z', 0.75)).atM[2], 0.75)],
    ['drive: walk-heading', async () => near((await walkTo('walk-heading', 120)).headingRad, 2 * Math.PI / 3)],
    ['drive: Walk there', async () => {
      const at = await look(() => ['walk-x', 'walk-z'].map((id) => Number(document.getElementById(id).value)));
      const {atM} = await goes(() => page.locator('#walk-z').press('Enter'));
      near(atM[0], at[0]);
      near(atM[2], at[1]);
    }],
    ['drive: Pass by', async () => {
      await page.locator('#walk-x').fill('1.5');
      await inDrive('Pass by');
      await toGo(0, 1);
      await page.locator('#walk-x').fill('0.5');
      const {waypointsM, atM} = await goes(() => inDrive('Walk there'), 1);
      near(waypointsM[0][0], 1.5);
      near(atM[0], 0.5);
    }],
    ['drive: drive-planting', () => plants(() => page.locator('#drive-planting').click())],
    ['drive: drive-layer-wave', () => layers('wave')],
    ['drive: drive-layer-carry', () => layers('carry')],
    ['drive: drive-ground', async () => {
      const grounds = await page.locator('#drive-ground option').evaluateAll(
        (options) => options.map(({value}) => value).filter((value) => value !== ''));
      assert.ok(grounds.length > 2);
      // Nothing but the ground is to change: it stands, from far enough to see what lies ahead of it, with
      // one quality, and without prints that fade.
      await holdQuality();
      await stands();
      for (let i = 0; i < 8; ++i) await key('-');
      await cameraRests(page);
      await look(() => window.stridewire.worlds[0].view.footprints.clear());
      const flat = await picture();
      for (const name of [...grounds.filter((name) => name !== 'flat'), 'flat']) {
        await page.locator('#drive-ground').selectOption(name);
        // Another client is told, and it is drawn.
        await until(`${name} is the ground`, () => (alpha.terrain === null) === (name === 'flat'));
        await until(`${name} is drawn`, async () =>
          (differing(flat, await picture()) > 0.003) === (name !== 'flat'));
        assert.equal(await page.locator('#drive-ground').inputValue(), name);
      }
      await key('f');
      await letQualityGo();
    }],
    ['inspect: Follow', () => follows(() => press('Follow', '#panel-inspect'))],
    ['page: Follow the chosen one', () => follows(() => press('Follow the chosen one'))],
    ['page: Frame all', () => frameAll(() => press('Frame all'))],
    ['playback: Pause', () => pauses(() => page.locator('.transport button.round').click())],
    ['playback: Speed', async () => {
      await page.getByLabel('Speed').selectOption('0.25');
      const from = await look(() => window.stridewire.playback.rate);
      near(from, 0.25);
      const behind = () => look(() => window.stridewire.client.renderTimeS() -
        window.stridewire.sampled()[0].timeS);
      await until('it falls behind', async () => await behind() > 0.5);
      await look(() => window.stridewire.playback.goLive());
      await live();
    }],
    ['playback: scrub', async () => {
      await eventually('there is something to go back to', () =>
        Number(document.getElementById('scrub').min) <= -2);
      await slide('scrub', -1.5);
      await frames(2);
      const back = await look(() => {
        const {recording} = window.stridewire.worlds[0].world;
        return recording.lastTimeS - window.stridewire.sampled()[0].timeS;
      });
      assert.ok(back > 1.3 && await look(() => window.stridewire.playback.paused), `${back} s back`);
      await slide('scrub', 0);
      await live();
    }],
    ['playback: Live', () => goesLive(() => press('Live'))],
    ['inspect: Parameter to the right', async () => {
      await stepping();
      await drawsOthers('Parameter to the right');
    }],
    ['inspect: Parameter upwards', async () => {
      await stepping();
      await drawsOthers('Parameter upwards');
      // What was chosen stays from one step to the next.
      const select = page.getByLabel('Parameter upwards');
      await select.selectOption('0');
      const start = await look(() => window.stridewire.inspected.movement.startTimeS);
      await look(() => window.stridewire.playback.goLive());
      await steps();
      await eventually('the next step', (t) =>
        window.stridewire.inspected?.movement?.parameterNames.length >= 2 &&
        window.stridewire.inspected.movement.startTimeS > t, start);
      assert.equal(await select.inputValue(), '0');
      await look(() => window.stridewire.playback.pause());
    }],
    ['inspect: joint-labels', async () => {
      const inked = async () => {
        await frames(2);
        return look(() => {
          const overlay = document.querySelector('canvas.overlay');
          const {data} = overlay.getContext('2d').getImageData(0, 0, overlay.width, overlay.height);
          let count = 0;
          for (let i = 3; i < data.length; i += 4) if (data[i] > 0) ++count;
          return count;
        });
      };
      const without = await inked();
      await page.locator('#joint-labels').check();
      assert.ok(await inked() > without + 500);
      await page.locator('#joint-labels').uncheck();
      assert.ok(await inked() < without + 100);
    }],
    ['inspect: Joints', async () => {
      await page.locator('#panel-inspect summary').click();
      const names = await page.locator('#panel-inspect .joints li').allInnerTexts();
      assert.deepEqual(names, await look(() => [...window.stridewire.worlds[0].world.skeleton.names]));
    }],
    ['view: view-shadows', () => shows('view-shadows')],
    ['view: view-prints', async () => {
      await look(() => window.stridewire.playback.goLive());
      const laid = await look(() => window.stridewire.sampled()[0].footprints);
      await steps();
      await eventually('prints are there', (n) => window.stridewire.sampled()[0].footprints >= n, laid + 4);
      await look(() => window.stridewire.playback.pause());
      await shows('view-prints');
    }],
    ['view: view-plants', async () => {
      // While it stands: both feet are planted.
      await look(() => window.stridewire.playback.goLive());
      await stands();
      await look(() => window.stridewire.playback.pause());
      await shows('view-plants');
      await look(() => window.stridewire.playback.goLive());
    }],
    ['view: figures-lines', async () => {
      await page.locator('label[for=figures-lines]').click();
      await eventually('lines', () => window.stridewire.draw.style === 'lines' &&
        document.querySelector('#panel-view .hint').textContent.startsWith('Drawn as lines now'));
    }],
    ['view: figures-auto', async () => {
      await page.locator('label[for=figures-auto]').click();
      await eventually('it chooses', () => window.stridewire.app.appearance.figures === 'auto' &&
        document.querySelector('#panel-view .hint').textContent.includes(window.stridewire.draw.style));
    }],
    ['view: figures-bodies', async () => {
      await page.locator('label[for=figures-lines]').click();
      await frames(2);
      const lines = await look(() => window.stridewire.draw.triangles);
      await page.locator('label[for=figures-bodies]').click();
      await eventually('bodies', (n) => window.stridewire.draw.style === 'bodies' &&
        window.stridewire.draw.triangles > n, lines);
    }],
    ['view: quality-low', async () => {
      await page.locator('label[for=quality-low]').click();
      await eventually('it is drawn as simply as can be', () =>
        window.stridewire.draw.level === window.stridewire.draw.levels - 1 &&
        document.querySelector('.quality').hidden);
    }],
    ['view: quality-high', async () => {
      await frames(2);
      const low = await look(() => window.stridewire.draw.triangles);
      await page.locator('label[for=quality-high]').click();
      await eventually('finer bodies', (n) => window.stridewire.draw.level === 0 &&
        window.stridewire.draw.triangles > 2 * n && document.querySelector('.quality').hidden, low);
      assert.ok(await page.locator('#view-shadows').isChecked());
    }],
    ['view: quality-auto', async () => {
      await page.locator('label[for=quality-auto]').click();
      await eventually('it chooses, and says so', () => window.stridewire.app.appearance.quality.lowered &&
        !document.querySelector('.quality').hidden);
    }],
    ['page: Quality lowered', async () => {
      await press('Close View');
      await press('Quality lowered');
      assert.ok(await page.locator('#panel-view').isVisible());
    }],
    ['view: mode-full', async () => {
      const quantised = await bytesAPose();
      await page.locator('label[for=mode-full]').click();
      await until('poses are larger', async () => await bytesAPose() > quantised + 150);
    }],
    ['view: mode-quantised', async () => {
      const full = await bytesAPose();
      await page.locator('label[for=mode-quantised]').click();
      await until('poses are smaller', async () => await bytesAPose() < full - 150);
    }],
    ...[['root', 16], ['fewer', 8], ['all', 0]].map(([detail, flag]) => [`view: detail-${detail}`, async () => {
      const all = await costOf('Quantised');
      await page.locator(`label[for=detail-${detail}]`).click();
      await eventually('poses are of that detail', (wanted) => {
        const {pose} = window.stridewire.worlds[0].view;
        return pose.count > 0 && (pose.flags[0] & 24) === wanted;
      }, flag);
      const {bytesAPose: now} = await costOf(
        {root: 'Quantised, root', fewer: 'Quantised, fewer', all: 'Quantised'}[detail], true);
      const less = {root: 70, fewer: 5}[detail];
      if (less) assert.ok(now < all.bytesAPose - less, `${now}, of all ${all.bytesAPose}`);
    }]),
    ...[2, 4, 1].map((every) => [`view: rate-${every}`, async () => {
      const all = await costOf('Quantised');
      await page.locator(`label[for=rate-${every}]`).click();
      const {bytesPerS: now} = await costOf(
        {1: 'Quantised', 2: 'Quantised, ½ rate', 4: 'Quantised, ¼ rate'}[every], true);
      if (every > 1) assert.ok(now < 1.4 * all.bytesPerS / every, `${now} bytes a second, of every tick ${all.bytesPerS}`);
    }]),
    ['inspect: Deselect', async () => {
      await opened('Inspect');
      await press('Deselect', '#panel-inspect');
      assert.equal(await chosen(), 0);
    }],
    ['page: the scene', async () => {
      await press('Frame all');
      await cameraRests(page);
      const at = await figureAt();
      await page.mouse.click(at.x, at.y);
      assert.equal(await chosen(), driven);
    }],
    ...['Drive', 'View', 'Inspect', 'Figures'].flatMap((name) => [
      [`page: ${name}`, () => toggles(name)],
      [`${name.toLowerCase()}: Close ${name}`, () => closes(name)],
    ]),
    ['page: Library', async () => {
      const link = await page.getByRole('link', {name: 'Library'}).getAttribute('href');
      const answer = await page.request.get(new URL(link, page.url()).href);
      assert.ok(answer.ok() && /<title>[^<]+</.test(await answer.text()), link);
    }],
    ['page: Dark or light', async () => {
      const theme = () => look(() => document.documentElement.dataset.theme);
      const clear = () => look(() => getComputedStyle(document.body).backgroundColor);
      const [was, colour] = [await theme(), await clear()];
      await page.locator('.corner button').nth(2).click();
      assert.notEqual(await theme(), was);
      assert.notEqual(await clear(), colour);
      await page.locator('.corner button').nth(2).click();
      assert.equal(await theme(), was);
    }],
    ['page: Keys and help', async () => {
      await press('Keys and help');
      assert.ok(await page.locator('dialog').isVisible());
    }],
    ['help: Close', async () => {
      await press('Close', 'dialog');
      assert.equal(await page.locator('dialog').isVisible(), false);
    }],
    ['page: a world', async () => {
      const names = () => look(() => window.stridewire.worlds.map(({name}) => name).join());
      const beta = page.locator('.chip', {hasText: 'beta'});
      await beta.click();
      assert.equal(await names(), 'alpha,beta');
      assert.deepEqual(await look(() => new URLSearchParams(location.search).getAll('world').sort()),
        ['alpha', 'beta']);
      await eventually('its avatar is seen', () => window.stridewire.sampled()[1].avatars.length === 1);
      await beta.click();
      assert.equal(await names(), 'alpha');
    }],
  ];

  // By what the help says; each of these is pressed or moved on the scene.
  const turned = async (act, changed) => {
    const was = await orbit();
    await act();
    // A page that draws slowly takes what the pointer did a frame later.
    await until('the camera wants to be elsewhere', async () => changed(was, await orbit()), 20);
  };
  const drag = async (dx, dy, options = {}) => {
    const {x, y} = await middle();
    await page.mouse.move(x, y);
    await page.mouse.down(options);
    await page.mouse.move(x + dx / 2, y + dy / 2);
    await page.mouse.move(x + dx, y + dy);
    await page.mouse.up(options);
  };
  /** Two fingers, each from one place to another, relative to the middle. */
  const twoFingers = async (from, to) => {
    const at = await middle();
    const points = (share) => from.map(([x, y], id) => ({
      id, x: at.x + x + (to[id][0] - x) * share, y: at.y + y + (to[id][1] - y) * share}));
    const touch = (type, touchPoints) => devtools.send('Input.dispatchTouchEvent', {type, touchPoints});
    await touch('touchStart', points(0));
    for (let i = 1; i <= 2; ++i) await touch('touchMove', points(i / 2));
    await touch('touchEnd', []);
    await frames(1);
  };
  const choose = async () => {
    await key('Escape');
    for (let i = 0; await chosen() !== driven; ++i) {
      assert.ok(i < 3);
      await key('n');
    }
  };
  const keys = {
    'Drag, arrow keys': async () => {
      await turned(() => drag(80, 0), (a, b) => b.wantAzimuth < a.wantAzimuth);
      await turned(() => drag(0, 40), (a, b) => b.wantElevation > a.wantElevation);
      // As a page that draws slowly hears of it: all of the way in one event.
      await turned(async () => {
        const {x, y} = await middle();
        await page.mouse.move(x, y);
        await page.mouse.down();
        await page.mouse.move(x - 80, y);
        await page.mouse.up();
      }, (a, b) => Math.abs(b.wantAzimuth - a.wantAzimuth - 80 * 0.006) < 1e-6);
      await turned(() => key('ArrowLeft'), (a, b) => b.wantAzimuth > a.wantAzimuth);
      await turned(() => key('ArrowRight'), (a, b) => b.wantAzimuth < a.wantAzimuth);
      await turned(() => key('ArrowDown'), (a, b) => b.wantElevation < a.wantElevation);
      await turned(() => key('ArrowUp'), (a, b) => b.wantElevation > a.wantElevation);
    },
    'Wheel, pinch, + −': async () => {
      await turned(() => key('+'), (a, b) => b.wantDistance < a.wantDistance);
      await turned(() => key('-'), (a, b) => b.wantDistance > a.wantDistance);
      const [near, far] = [[[-30, 0], [30, 0]], [[-90, 0], [90, 0]]];
      // Twice as far apart, half as far away, but where the camera's range ends.
      await turned(() => twoFingers(near, far), (a, b) => b.wantDistance < a.wantDistance * 0.6 &&
        b.wantAzimuth === a.wantAzimuth);
      await turned(() => twoFingers(far, near), (a, b) => b.wantDistance > a.wantDistance * 1.6 &&
        b.wantAzimuth === a.wantAzimuth);
      // The page itself keeps its size.
      assert.equal(await look(() => visualViewport.scale), 1);
    },
    'Shift or right drag, two fingers': async () => {
      for (const right of [false, true]) {
        const was = await target();
        if (right) {
          await drag(60, 30, {button: 'right'});
        } else {
          await page.keyboard.down('Shift');
          await drag(60, 30);
          await page.keyboard.up('Shift');
        }
        assert.notDeepEqual(await target(), was);
      }
      const was = await target();
      const away = (await orbit()).wantDistance;
      await twoFingers([[-40, 0], [40, 0]], [[20, 30], [100, 30]]);
      assert.notDeepEqual(await target(), was);
      assert.ok(Math.abs((await orbit()).wantDistance / away - 1) < 0.05);
    },
    'F': () => frameAll(() => key('f')),
    'C, double click': async () => {
      await choose();
      await follows(() => key('c'));
      await key('f');
      await cameraRests(page);
      const at = await figureAt();
      await page.mouse.dblclick(at.x, at.y);
      // The first click may open a panel, which moves the figure from under the second.
      await until('it is followed', async () => {
        if (await following() === driven) return true;
        await cameraRests(page);
        const {x, y} = await figureAt();
        await page.mouse.dblclick(x, y);
        return false;
      });
      await key('f');
    },
    'Click, N, P': async () => {
      await key('Escape');
      await key('n');
      assert.equal(await chosen(), driven);
      await spawns(() => key('b'));
      const newest = driven;
      await key('p');
      assert.notEqual(await chosen(), newest);
      await key('n');
      assert.equal(await chosen(), newest);
      await removes(() => key('Delete'));
      [driven] = await avatars();
      await choose();
    },
    'Esc': async () => {
      await choose();
      await key('Escape');
      assert.equal(await chosen(), 0);
      await choose();
    },
    'Space': () => pauses(() => key(' ')),
    '[ ]': async () => {
      const rate = () => look(() => window.stridewire.playback.rate);
      await key('[');
      near(await rate(), 0.5);
      await key('[');
      near(await rate(), 0.25);
      await key(']');
      near(await rate(), 0.5);
      await key('l');
    },
    ', .': async () => {
      await key(' ');
      await frames(2);
      const at = () => look(() => window.stridewire.playback.timeS);
      const was = await at();
      await key(',');
      assert.ok(Math.abs(await at() - was + 1 / 30) < 1e-6);
      await key('.');
      assert.ok(Math.abs(await at() - was) < 1e-6);
    },
    'L': () => goesLive(() => key('l')),
    'W, A, D': async () => {
      for (const [letter, foot] of [['w', 'auto'], ['a', 'left'], ['d', 'right']]) {
        const item = await adds(() => key(letter));
        assert.deepEqual([item.type, item.foot], ['step', foot]);
      }
    },
    'Q, E': async () => {
      for (const [letter, degrees] of [['q', 5], ['e', 0], ['e', -5], ['q', 0]]) {
        await key(letter);
        assert.equal(await page.locator('#turn').inputValue(), String(degrees));
      }
    },
    'R, V': async () => {
      const length = async () => Number(await page.locator('#step-length').inputValue());
      const was = await length();
      await key('r');
      near(await length(), was + 0.05);
      await key('v');
      near(await length(), was);
    },
    'T': () => places(() => key('t')),
    'M': () => sends(() => key('m')),
    'M, then drag': async () => {
      await cameraRests(page);
      await key('m');
      const [from, to] = await beside([0.4, 0.4], [0.9, 0.1]);
      const camera = await orbit();
      const {atM, headingRad} = await goes(async () => {
        await page.mouse.move(from.x, from.y);
        await page.mouse.down();
        await page.mouse.move((from.x + to.x) / 2, (from.y + to.y) / 2);
        await page.mouse.move(to.x, to.y);
        await page.mouse.up();
      });
      closeTo(atM, from.at);
      assert.ok(Math.abs(headingRad - Math.atan2(0.5, -0.3)) < 0.1, `${headingRad}`);
      assert.deepEqual(await orbit(), camera);
      await key('m');
    },
    'M, then Shift click, long touch': async () => {
      await cameraRests(page);
      await key('m');
      const [first, second, goal] = await beside([0.5, 0.2], [0.3, 0.6], [-0.4, 0.5]);
      const item = await goes(async () => {
        await page.keyboard.down('Shift');
        await page.mouse.click(first.x, first.y);
        await page.keyboard.up('Shift');
        await toGo(0, 1);
        const touch = (type, touchPoints) => devtools.send('Input.dispatchTouchEvent', {type, touchPoints});
        await touch('touchStart', [{x: second.x, y: second.y}]);
        const beganMs = await look(() => performance.now());
        await eventually('the finger rested', (ms) => performance.now() > ms + 700, beganMs);
        await touch('touchEnd', []);
        await toGo(0, 2);
        await page.touchscreen.tap(goal.x, goal.y);
      }, 2);
      closeTo(item.waypointsM[0], first.at);
      closeTo(item.waypointsM[1], second.at);
      closeTo(item.atM, goal.at);
      // Escape takes places back before it lays the tool down.
      await page.keyboard.down('Shift');
      await page.mouse.click(first.x, first.y);
      await page.keyboard.up('Shift');
      await toGo(0, 1);
      await key('Escape');
      await toGo(0, 0);
      assert.ok(await pressed('drive-walk'));
      await key('Escape');
      assert.equal(await pressed('drive-walk'), false);
      assert.equal(await chosen(), driven);
    },
    'Drag an outlined print': async () => {
      await cameraRests(page);
      const [from, to] = await look((number) => {
        const {view} = window.stridewire.worlds[0];
        const {x, z} = view.place(number);
        return [[x + 0.4, 0, z + 0.3], [x + 0.1, 0, z + 0.45]].map((at) => ({at, ...view.onPage(at)}));
      }, driven);
      await adds(() => alpha.request([
        {avatar: driven, type: 'step', atM: from.at}, {avatar: driven, type: 'step', foot: 'left', atM: [9, 0, 9]}]));
      await eventually('both are marked', () => window.stridewire.sampled()[0].planned === 2);
      const camera = await orbit();
      await page.mouse.move(from.x, from.y);
      await page.mouse.down();
      await page.mouse.move((from.x + to.x) / 2, (from.y + to.y) / 2);
      await page.mouse.move(to.x, to.y);
      await page.mouse.up();
      await until('it is to land there', async () => {
        const places = (await alpha.inspect(driven)).queue.flatMap(({atM}) => atM === null ? [] : [atM]);
        return places.length === 2 && Math.hypot(places[0][0] - to.at[0], places[0][2] - to.at[2]) < 0.03 &&
          places[1][0] === 9;
      });
      assert.deepEqual(await orbit(), camera);
      await alpha.cancel([driven]);
      await eventually('the marks are gone', () => window.stridewire.sampled()[0].planned === 0);
    },
    'K': () => plants(() => key('k')),
    'J': async () => assert.equal((await adds(() => key('j'))).type, 'jump'),
    'S': async () => assert.equal((await adds(() => key('s'))).type, 'stand'),
    'X': () => queueIsEmpty(() => key('x')),
    'B, Delete': async () => {
      const was = driven;
      await spawns(() => key('b'));
      await removes(() => key('Delete'));
      driven = was;
      await choose();
    },
    'G': () => wanders(() => key('g'), 1),
  };

  const seen = new Set(await controlsOf(page));
  for (const [name, check] of checks) {
    const began = performance.now();
    try {
      await check();
      tell(began, name);
    } catch (error) {
      error.message = `${name}: ${error.message}`;
      await keep(page, 'failed_control');
      throw error;
    }
    for (const control of await controlsOf(page)) seen.add(control);
  }
  assert.deepEqual([...seen].sort(), checks.map(([name]) => name).sort());

  await opened('Drive');
  const told = await page.locator('dialog dt').allTextContents();
  assert.deepEqual(told.sort(), Object.keys(keys).sort());
  for (const [name, check] of Object.entries(keys)) {
    const began = performance.now();
    try {
      await check();
      tell(began, `keys ${name}`);
    } catch (error) {
      error.message = `keys ${name}: ${error.message}`;
      await keep(page, 'failed_key');
      throw error;
    }
  }
  console.log(`${seen.size} controls and ${told.length} lines of the help do as they say`);
  assert.deepEqual(errors, []);
  await context.close();
});
