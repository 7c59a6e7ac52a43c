// A check for each row of the help dialog: keys, clicks, drags and gestures.

import assert from 'node:assert/strict';

import {assertClose, assertNear, sharedChecks} from './controls_page.mjs';
import {waitFor, waitForCamera} from './support.mjs';

/** `t`: result of `openControlsPage`. Returns checks by the keys in the help dialog. */
export function keyChecks(t) {
  const shared = sharedChecks(t);
  return {...cameraChecks(t, shared), ...playbackChecks(t, shared), ...commandChecks(t, shared),
    ...walkToolChecks(t, shared), ...footprintChecks(t)};
}

/** Deselects, then selects the avatar that receives commands. */
async function selectAvatar(t) {
  await t.key('Escape');
  for (let i = 0; await t.selectedAvatar() !== t.state.avatar; ++i) {
    assert.ok(i < 3);
    await t.key('n');
  }
}

async function shiftClick(page, {x, y}) {
  await page.keyboard.down('Shift');
  await page.mouse.click(x, y);
  await page.keyboard.up('Shift');
}

async function drag(page, from, to, options = {}) {
  await page.mouse.move(from.x, from.y);
  await page.mouse.down(options);
  await page.mouse.move((from.x + to.x) / 2, (from.y + to.y) / 2);
  await page.mouse.move(to.x, to.y);
  await page.mouse.up(options);
}

function cameraChecks(t, shared) {
  const {page, devtools, state, look, key} = t;
  /**
   * Checks the effect of `act` on the orbit. A slow page handles pointer events one frame later.
   */
  const changesOrbit = async (act, condition) => {
    const before = await t.orbit();
    await act();
    await waitFor('the orbit has changed', async () => condition(before, await t.orbit()), 20);
  };
  const dragScene = async (dx, dy, options = {}) => {
    const from = await t.sceneCentre();
    await drag(page, from, {x: from.x + dx, y: from.y + dy}, options);
  };
  /** Moves two fingers; points are relative to the centre of the scene. */
  const moveTwoFingers = async (from, to) => {
    const centre = await t.sceneCentre();
    const points = (share) => from.map(([x, y], id) => ({
      id, x: centre.x + x + (to[id][0] - x) * share, y: centre.y + y + (to[id][1] - y) * share}));
    const touch = (type, touchPoints) =>
      devtools.send('Input.dispatchTouchEvent', {type, touchPoints});
    await touch('touchStart', points(0));
    for (let i = 1; i <= 2; ++i) await touch('touchMove', points(i / 2));
    await touch('touchEnd', []);
    await t.frames(1);
  };
  return {
    'Drag, arrow keys': async () => {
      await changesOrbit(() => dragScene(80, 0), (a, b) => b.azimuthRad < a.azimuthRad);
      await changesOrbit(() => dragScene(0, 40), (a, b) => b.elevationRad > a.elevationRad);
      // A slow page may receive the whole drag as one event.
      await changesOrbit(async () => {
        const {x, y} = await t.sceneCentre();
        await page.mouse.move(x, y);
        await page.mouse.down();
        await page.mouse.move(x - 80, y);
        await page.mouse.up();
      }, (a, b) => Math.abs(b.azimuthRad - a.azimuthRad - 80 * 0.006) < 1e-6);
      await changesOrbit(() => key('ArrowLeft'), (a, b) => b.azimuthRad > a.azimuthRad);
      await changesOrbit(() => key('ArrowRight'), (a, b) => b.azimuthRad < a.azimuthRad);
      await changesOrbit(() => key('ArrowDown'), (a, b) => b.elevationRad < a.elevationRad);
      await changesOrbit(() => key('ArrowUp'), (a, b) => b.elevationRad > a.elevationRad);
    },
    'Wheel, pinch, + −': async () => {
      await changesOrbit(() => key('+'), (a, b) => b.distanceM < a.distanceM);
      await changesOrbit(() => key('-'), (a, b) => b.distanceM > a.distanceM);
      const [close, apart] = [[[-30, 0], [30, 0]], [[-90, 0], [90, 0]]];
      // The distance changes by the factor of the pinch, within the camera's limits.
      await changesOrbit(() => moveTwoFingers(close, apart), (a, b) =>
        b.distanceM < a.distanceM * 0.6 && b.azimuthRad === a.azimuthRad);
      await changesOrbit(() => moveTwoFingers(apart, close), (a, b) =>
        b.distanceM > a.distanceM * 1.6 && b.azimuthRad === a.azimuthRad);
      // The browser does not zoom the page itself.
      assert.equal(await look(() => visualViewport.scale), 1);
    },
    'Shift drag, right drag, two fingers': async () => {
      for (const right of [false, true]) {
        const before = await t.cameraTarget();
        if (right) {
          await dragScene(60, 30, {button: 'right'});
        } else {
          await page.keyboard.down('Shift');
          await dragScene(60, 30);
          await page.keyboard.up('Shift');
        }
        assert.notDeepEqual(await t.cameraTarget(), before);
      }
      const before = await t.cameraTarget();
      const {distanceM} = await t.orbit();
      await moveTwoFingers([[-40, 0], [40, 0]], [[20, 30], [100, 30]]);
      assert.notDeepEqual(await t.cameraTarget(), before);
      assert.ok(Math.abs((await t.orbit()).distanceM / distanceM - 1) < 0.05);
    },
    'F': () => shared.framesAll(() => key('f')),
    'C, double click': async () => {
      await selectAvatar(t);
      await shared.follows(() => key('c'));
      await key('f');
      await waitForCamera(page);
      const at = await t.clickPoint();
      await page.mouse.dblclick(at.x, at.y);
      // The first click may open a panel, which moves the avatar away from the second click.
      await waitFor('the avatar is followed', async () => {
        if (await t.followedAvatar() === state.avatar) return true;
        await waitForCamera(page);
        const {x, y} = await t.clickPoint();
        await page.mouse.dblclick(x, y);
        return false;
      });
      await key('f');
    },
    'Click, N, P': async () => {
      await key('Escape');
      await key('n');
      assert.equal(await t.selectedAvatar(), state.avatar);
      await shared.spawns(() => key('b'));
      const newest = state.avatar;
      await key('p');
      assert.notEqual(await t.selectedAvatar(), newest);
      await key('n');
      assert.equal(await t.selectedAvatar(), newest);
      await shared.removes(() => key('Delete'));
      [state.avatar] = await t.avatars();
      await selectAvatar(t);
    },
    'Esc': async () => {
      await selectAvatar(t);
      await key('Escape');
      assert.equal(await t.selectedAvatar(), 0);
      await selectAvatar(t);
    },
  };
}

function playbackChecks(t, shared) {
  const {look, key} = t;
  return {
    'Space': () => shared.pauses(() => key(' ')),
    '[ ]': async () => {
      const rate = () => look(() => window.stridewire.playback.rate);
      await key('[');
      assertNear(await rate(), 0.5);
      await key('[');
      assertNear(await rate(), 0.25);
      await key(']');
      assertNear(await rate(), 0.5);
      await key('l');
    },
    ', .': async () => {
      await key(' ');
      await t.frames(2);
      const timeS = () => look(() => window.stridewire.playback.timeS);
      const before = await timeS();
      await key(',');
      assert.ok(Math.abs(await timeS() - before + 1 / 30) < 1e-6);
      await key('.');
      assert.ok(Math.abs(await timeS() - before) < 1e-6);
    },
    'L': () => shared.goesLive(() => key('l')),
  };
}

function commandChecks(t, shared) {
  const {page, state, key} = t;
  return {
    'W, A, D': async () => {
      for (const [letter, foot] of [['w', 'auto'], ['a', 'left'], ['d', 'right']]) {
        const item = await t.requestOf(() => key(letter));
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
      const before = await length();
      await key('r');
      assertNear(await length(), before + 0.05);
      await key('v');
      assertNear(await length(), before);
    },
    'K': () => shared.togglesPlanting(() => key('k')),
    'J': async () => assert.equal((await t.requestOf(() => key('j'))).type, 'jump'),
    'S': async () => assert.equal((await t.requestOf(() => key('s'))).type, 'stand'),
    'X': () => shared.clearsQueue(() => key('x')),
    'B, Delete': async () => {
      const before = state.avatar;
      await shared.spawns(() => key('b'));
      await shared.removes(() => key('Delete'));
      state.avatar = before;
      await selectAvatar(t);
    },
    'G': () => shared.walksRandomly(() => key('g'), 1),
  };
}

function walkToolChecks(t, shared) {
  const {page, devtools, state, look, eventually, key} = t;
  return {
    'M': () => shared.sendsAvatar(() => key('m')),
    'M, then drag': async () => {
      await waitForCamera(page);
      await key('m');
      const [from, to] = await t.pointsBeside([0.4, 0.4], [0.9, 0.1]);
      const orbitBefore = await t.orbit();
      const {atM, headingRad} = await t.walkOf(() => drag(page, from, to));
      assertClose(atM, from.at);
      assert.ok(Math.abs(headingRad - Math.atan2(0.5, -0.3)) < 0.1, `${headingRad}`);
      assert.deepEqual(await t.orbit(), orbitBefore);
      await key('m');
    },
    'M, then Shift click or long touch': async () => {
      await waitForCamera(page);
      await key('m');
      const [first, second, goal] = await t.pointsBeside([0.5, 0.2], [0.3, 0.6], [-0.4, 0.5]);
      const item = await t.walkOf(async () => {
        await shiftClick(page, first);
        await t.waitForGoals(0, 1);
        const touch = (type, touchPoints) =>
          devtools.send('Input.dispatchTouchEvent', {type, touchPoints});
        await touch('touchStart', [{x: second.x, y: second.y}]);
        const beganMs = await look(() => performance.now());
        await eventually('the touch is long', (ms) => performance.now() > ms + 700, beganMs);
        await touch('touchEnd', []);
        await t.waitForGoals(0, 2);
        await page.touchscreen.tap(goal.x, goal.y);
      }, 2);
      assertClose(item.waypointsM[0], first.at);
      assertClose(item.waypointsM[1], second.at);
      assertClose(item.atM, goal.at);
      // Escape removes waypoints first, and then deactivates the tool.
      await shiftClick(page, first);
      await t.waitForGoals(0, 1);
      await key('Escape');
      await t.waitForGoals(0, 0);
      assert.ok(await t.isPressed('command-walk-there'));
      await key('Escape');
      assert.equal(await t.isPressed('command-walk-there'), false);
      assert.equal(await t.selectedAvatar(), state.avatar);
    },
  };
}

function footprintChecks(t) {
  const {page, alpha, state, key} = t;
  return {
    'T': () => sharedChecks(t).placesFootprints(() => key('t')),
    'Drag an outlined footprint': async () => {
      await waitForCamera(page);
      const [from, to] = await t.pointsBeside([0.4, 0.3], [0.1, 0.45]);
      await t.requestOf(() => alpha.request([
        {avatar: state.avatar, type: 'step', atM: from.at},
        {avatar: state.avatar, type: 'step', foot: 'left', atM: [9, 0, 9]}]));
      await t.waitForOutlines(2);
      const orbitBefore = await t.orbit();
      await drag(page, from, to);
      await waitFor('the first step has moved', async () => {
        const {queue} = await alpha.inspect(state.avatar);
        const points = queue.flatMap(({atM}) => atM === null ? [] : [atM]);
        return points.length === 2 && points[1][0] === 9 &&
          Math.hypot(points[0][0] - to.at[0], points[0][2] - to.at[2]) < 0.03;
      });
      assert.deepEqual(await t.orbit(), orbitBefore);
      await alpha.cancel([state.avatar]);
      await t.waitForOutlines(0);
    },
  };
}
