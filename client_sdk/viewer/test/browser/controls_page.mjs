// The page that the tests of controls and keys use, and helpers that check one kind of control
// each.

import assert from 'node:assert/strict';

import {createPose} from '@stridewire/client';

import {differingShare, openPage, waitFor, waitForCamera, waitForFrames} from './support.mjs';

/** Number of avatars that the card of an empty world spawns. */
export const spawnedByCard = 8;
/** Stands of this duration keep an avatar busy. */
const standS = 2;

export const assertNear = (a, b) => assert.ok(Math.abs(a - b) < 1e-4, `${a}, not ${b}`);
export const assertClose = (at, expected) => at.forEach(
  (v, k) => assert.ok(Math.abs(v - expected[k]) < 0.03, `${at}, not ${expected}`));

/**
 * Opens the viewer with world alpha. `client` and `alpha` are a second connection and its view of
 * the world, with which the helpers check the effects of controls.
 */
export async function openControlsPage(browser, server, client, alpha) {
  const {page, context, errors} = await openPage(
    browser, server.httpPort, 'world=alpha&figures=bodies',
    // The smallest page with panels beside the scene.
    {hasTouch: true, viewport: {width: 920, height: 540}});
  const devtools = await context.newCDPSession(page);
  await waitFor('the page has loaded', () => page.evaluate(
    () => window.stridewire?.worlds[0]?.world.skeleton));

  /** `avatar`: id of the avatar that receives commands. */
  const state = {avatar: 0};

  // ---- the page

  const look = (f, argument) => page.evaluate(f, argument);
  const eventually = (what, f, argument) => waitFor(what, () => page.evaluate(f, argument));
  const press = (name, where = 'body') =>
    page.locator(where).getByRole('button', {name, exact: true}).click();
  const pressCommand = (name) => press(name, '#panel-commands');
  const key = (name) => page.locator('canvas.scene').press(name);
  const setSlider = (id, value) => page.locator(`#${id}`).fill(String(value));
  const isPressed = async (id) =>
    await page.locator(`#${id}`).getAttribute('aria-pressed') === 'true';
  const frames = (count) => waitForFrames(page, count);
  const avatars = () => look(() => [...window.stridewire.worlds[0].world.avatars()]);
  const selectedAvatar = () => look(() => window.stridewire.selection?.avatar ?? 0);
  const waitForLive = () => eventually('playback is live', () => window.stridewire.playback.live);
  const sceneImage = async () => {
    await frames(2);
    return page.screenshot({clip: await look(() => {
      const {x, y, width, height} = window.stridewire.worlds[0].view.freeArea;
      return {
        x: Math.ceil(x), y: Math.ceil(y), width: Math.floor(width), height: Math.floor(height)};
    })});
  };
  /** Keeps slow frames from changing the quality between two screenshots. */
  const holdQuality = async () => {
    await look(() => window.stridewire.app.appearance.setQuality('low'));
    await frames(2);
  };
  const releaseQuality = () => look(() => window.stridewire.app.appearance.setQuality('auto'));
  /** Centre of the part of the scene that no panel covers. */
  const sceneCentre = async () => {
    // The next frame updates the free area.
    await frames(2);
    const {onScene, ...at} = await look(() => {
      const {x, y, width, height} = window.stridewire.worlds[0].view.freeArea;
      const at = {x: x + width / 2, y: y + height / 2};
      return {...at, onScene: document.elementFromPoint(at.x, at.y)?.matches('canvas.scene')};
    });
    assert.ok(onScene, `an element covers the scene at ${JSON.stringify(at)}`);
    return at;
  };
  const orbit = () => look(() => {
    const {desiredAzimuthRad, desiredElevationRad, desiredDistanceM} =
      window.stridewire.app.camera.orbit;
    return {
      azimuthRad: desiredAzimuthRad, elevationRad: desiredElevationRad,
      distanceM: desiredDistanceM};
  });
  const cameraTarget = () => look(() =>
    window.stridewire.worlds[0].view.viewCamera.desiredTarget.toArray());
  const followedAvatar = () => look(() => window.stridewire.worlds[0].view.followedAvatar);
  /** Positions on the page of points of flat terrain, given as offsets (x, z) from the avatar. */
  const pointsBeside = (...offsets) => look(([avatar, all]) => {
    const {view} = window.stridewire.worlds[0];
    const {x, z} = view.locate(avatar);
    return all.map(([dx, dz]) => {
      const at = [x + dx, 0, z + dz];
      return {at, ...view.projectToPage(at)};
    });
  }, [state.avatar, offsets]);
  /** A point of the page where a click hits the avatar. */
  const clickPoint = () => waitFor('the avatar can be clicked', () => look((avatar) => {
    const {view} = window.stridewire.worlds[0];
    const {x, y, width, height} = view.freeArea;
    for (let row = y + 4; row < y + height; row += 6) {
      for (let column = x + 4; column < x + width; column += 6) {
        if (view.pick(column, row, 4) === avatar) return {x: column, y: row};
      }
    }
    return null;
  }, state.avatar));
  const openPanel = async (name) => {
    if (await page.locator(`#panel-${name.toLowerCase()}`).isVisible()) return;
    await page.locator('nav.tools').getByRole('button', {name, exact: true}).click();
  };

  // ---- the avatar

  /** Fills the queue, so that requests added to it do not start. */
  const keepBusy = async () => {
    await alpha.cancel([state.avatar]);
    await waitFor('the avatar is busy', async () => {
      const {movement, queueSize} = await alpha.inspect(state.avatar);
      if (movement !== null && queueSize >= 10) return true;
      await alpha.request(Array.from({length: 12 - queueSize}, () => (
        {avatar: state.avatar, type: 'stand', seconds: standS})));
      return false;
    });
  };
  /** Returns the request that `act` adds to the queue. */
  const requestOf = async (act) => {
    await keepBusy();
    const {queueSize} = await alpha.inspect(state.avatar);
    await act();
    // An earlier request may have started in the meantime.
    return waitFor('a request is queued', async () => {
      const {queue} = await alpha.inspect(state.avatar);
      const last = queue.at(-1);
      const isNew = last && !(last.type === 'stand' && last.seconds === standS);
      return isNew && queue.length <= queueSize + 1 ? last : null;
    });
  };
  /** Clears the queue, and waits until the page shows the idle avatar. */
  const makeIdle = async () => {
    await alpha.cancel([state.avatar]);
    const {timeS} = await waitFor('the avatar is idle', async () => {
      const now = await alpha.inspect(state.avatar);
      return now.movement === null && now.queueSize === 0 ? now : null;
    });
    await eventually('the page shows that',
      (t) => window.stridewire.sampled()[0].timeS > t + 0.5, timeS);
  };
  const requestSteps = () => alpha.request(
    Array.from({length: 12}, () => ({avatar: state.avatar, type: 'step', lengthM: 0.6})));
  /** Pauses playback during a step whose examples the inspector shows. */
  const pauseDuringStep = () => waitFor('playback is paused during a step', async () => {
    await look(() => window.stridewire.playback.goLive());
    if ((await alpha.inspect(state.avatar)).queueSize < 4) await requestSteps();
    await eventually('a step is inspected', () =>
      window.stridewire.inspected?.movement?.exampleParameters.length > 0);
    await look(() => window.stridewire.playback.pause());
    await frames(3);
    return look(() => window.stridewire.inspected?.movement?.parameterNames.length >= 2 &&
      document.querySelectorAll('.scatter .site').length > 1);
  });
  const waitForGoals = (goals, waypoints) =>
    eventually(`${goals} goals and ${waypoints} waypoints are shown`, (expected) => {
      const sampled = window.stridewire.sampled()[0];
      return sampled.goals === expected.goals && sampled.waypoints === expected.waypoints;
    }, {goals, waypoints});
  const waitForOutlines = (count) => eventually(`${count} footprints are outlined`,
    (n) => window.stridewire.sampled()[0].planned === n, count);
  /** Returns the walk that `act` requests, after checking its decals. Another client cancels it. */
  const walkOf = async (act, waypoints = 0) => {
    const item = await requestOf(act);
    assert.equal(item.type, 'walk');
    assert.equal(item.waypointsM.length, waypoints);
    await waitForGoals(1, waypoints);
    assert.equal(await selectedAvatar(), state.avatar);
    await alpha.cancel([state.avatar]);
    await waitForGoals(0, 0);
    return item;
  };
  const walkFromField = async (id, value) => {
    await page.locator(`#${id}`).fill(String(value));
    return walkOf(() => pressCommand('Start walk'));
  };
  const waitForRandomWalkers = (count) => eventually(`${count} avatars walk at random`, (n) =>
    window.stridewire.worlds[0] && window.stridewire.app.panes[0].randomWalkers?.size === n, count);
  const waitForWalking = () => waitFor('the avatar walks', async () =>
    (await alpha.inspect(state.avatar)).movement?.requestId);

  // ---- statistics

  const measureBytesPerPose = async () => {
    const count = () => look(() => {
      const {bytesReceived, posesReceived} = window.stridewire.client.statistics;
      return {bytes: bytesReceived, poses: posesReceived};
    });
    const from = await count();
    const to = await waitFor('30 poses have arrived', async () => {
      const now = await count();
      return now.poses >= from.poses + 30 ? now : null;
    });
    return (to.bytes - from.bytes) / (to.poses - from.poses);
  };
  /** The cost of a stream in the table. `active`: wait until that stream is in use. */
  const streamCost = (name, active = false) => waitFor(`the cost of ${name} is shown`, () =>
    look(([expected, mustBeActive]) => {
      const row = [...document.querySelectorAll('.costs tbody tr')].find((each) =>
        each.querySelector('th').textContent === expected &&
        (!mustBeActive || each.getAttribute('aria-current') === 'true'));
      const {costs} = window.stridewire.app.streamCosts;
      return row ? costs.find((cost) => cost.name === expected) : null;
    }, [name, active]));

  return {
    page, context, errors, devtools, client, alpha, state,
    look, eventually, press, pressCommand, key, setSlider, isPressed, frames, avatars,
    selectedAvatar, waitForLive, sceneImage, holdQuality, releaseQuality, sceneCentre, orbit,
    cameraTarget, followedAvatar, pointsBeside, clickPoint, openPanel, keepBusy, requestOf,
    makeIdle,
    requestSteps, pauseDuringStep, waitForGoals, waitForOutlines, walkOf, walkFromField,
    waitForRandomWalkers, waitForWalking, measureBytesPerPose, streamCost,
  };
}

/** Checks that are used for both a button and its key; `act` presses one of them. */
export function sharedChecks(t) {
  const {page, client, alpha, state, look, eventually} = t;
  return {
    async clearsQueue(act) {
      await t.keepBusy();
      await act();
      await waitFor('the queue is empty', async () =>
        (await alpha.inspect(state.avatar)).queueSize === 0);
    },
    async spawns(act) {
      const before = await t.avatars();
      await act();
      await eventually('there is one more avatar', (n) =>
        window.stridewire.worlds[0].world.avatars().length === n, before.length + 1);
      state.avatar = (await t.avatars()).find((avatar) => !before.includes(avatar));
      await eventually('the new avatar is selected and drawn', (n) =>
        window.stridewire.selection?.avatar === n &&
        window.stridewire.sampled()[0].avatars.includes(n), state.avatar);
    },
    async removes(act) {
      await act();
      await eventually('the avatar is removed', (n) =>
        !window.stridewire.worlds[0].world.avatars().includes(n), state.avatar);
    },
    async follows(act) {
      await act();
      assert.equal(await t.followedAvatar(), state.avatar);
      await act();
      assert.equal(await t.followedAvatar(), 0);
    },
    async walksRandomly(act, count) {
      await act();
      await t.waitForRandomWalkers(count);
      await t.waitForWalking();
      await act();
      await t.waitForRandomWalkers(0);
      await alpha.cancel([state.avatar]);
    },
    async framesAll(act) {
      await t.key('+');
      await act();
      await waitFor('the button is pressed', async () =>
        await page.getByRole('button', {name: 'Frame all'}).getAttribute('aria-pressed') ===
          'true');
      await t.frames(1);
      const framed = (await t.orbit()).distanceM;
      const {x, y} = await t.sceneCentre();
      await page.mouse.move(x, y);
      await page.mouse.wheel(0, 600);
      await waitFor('the camera zooms out', async () => (await t.orbit()).distanceM > framed);
      await act();
      await waitFor('all avatars are framed again', async () =>
        Math.abs((await t.orbit()).distanceM - framed) < 0.5);
    },
    async pauses(act) {
      const timeS = async () => (await look(() => window.stridewire.sampled()))[0].timeS;
      await act();
      await eventually('playback is paused', () => window.stridewire.playback.paused);
      const at = await timeS();
      await t.frames(3);
      assert.ok(await timeS() - at < 1e-6);
      await act();
      await waitFor('playback continues', async () => await timeS() > at);
    },
    async goesLive(act) {
      await look(() => window.stridewire.playback.pause());
      await act();
      await t.waitForLive();
    },
    /** The button must also show what other clients set. */
    async togglesPlanting(act) {
      const isPlanted = (on) => waitFor(`planting is ${on ? 'on' : 'off'}`, async () =>
        (await alpha.inspect(state.avatar)).plantingEnabled === on &&
        await t.isPressed('command-planting') === on);
      await isPlanted(true);
      for (const on of [false, true]) {
        await act();
        await isPlanted(on);
      }
      for (const on of [false, true]) {
        assert.ok((await alpha.setPlanting([state.avatar], on)).ok);
        await isPlanted(on);
      }
    },
    /** `toggle` activates and deactivates the step tool. */
    async placesFootprints(toggle) {
      await waitForCamera(page);
      await toggle();
      assert.ok(await t.isPressed('command-step-there'));
      const [point] = await t.pointsBeside([0.35, 0.3]);
      const item = await t.requestOf(() => page.mouse.click(point.x, point.y));
      assert.equal(item.type, 'step');
      assertClose(item.atM, point.at);
      assert.equal(await t.selectedAvatar(), state.avatar);
      await t.waitForOutlines(1);
      await toggle();
      assert.equal(await t.isPressed('command-step-there'), false);
      await alpha.cancel([state.avatar]);
      await t.waitForOutlines(0);
    },
    /** `toggle` activates and deactivates the walk tool. */
    async sendsAvatar(toggle) {
      const [step, walk] = ['command-step-there', 'command-walk-there'];
      await waitForCamera(page);
      await toggle();
      assert.ok(await t.isPressed(walk) && !await t.isPressed(step));
      const [point] = await t.pointsBeside([0.5, 0.4]);
      assertClose((await t.walkOf(() => page.mouse.click(point.x, point.y))).atM, point.at);
      // Only one tool is active at a time.
      await page.locator(`#${step}`).click();
      assert.ok(await t.isPressed(step) && !await t.isPressed(walk));
      await toggle();
      assert.ok(await t.isPressed(walk) && !await t.isPressed(step));
      await toggle();
      assert.equal(await t.isPressed(walk) || await t.isPressed(step), false);
    },
    /** The button starts and ends the layer, which changes the pose of the right arm. */
    async togglesLayer(layer) {
      await t.makeIdle();
      const subscription = alpha.observe({mode: 'full', avatars: [state.avatar]});
      const pose = createPose();
      const joint = alpha.skeleton.names.indexOf('RightArm');
      const armRotation = () => waitFor('a pose has arrived', () => {
        const timeS = client.renderTimeS();
        return timeS !== null && alpha.sample(state.avatar, timeS, pose) !== 'missing' &&
          [...pose.rotations.subarray(4 * joint, 4 * joint + 4)];
      });
      const without = await armRotation();
      const isRaised = async () => {
        const now = await armRotation();
        return Math.abs(now.reduce((sum, x, i) => sum + x * without[i], 0)) < 0.99;
      };
      const toggle = page.locator(`#command-layer-${layer}`);
      for (const on of [true, false]) {
        await toggle.click();
        await waitFor(`the layer is ${on ? 'on' : 'off'}`, async () =>
          await isRaised() === on && await toggle.getAttribute('aria-pressed') === String(on));
      }
      await subscription.stop();
    },
    async togglesPanel(name) {
      const panel = page.locator(`#panel-${name.toLowerCase()}`);
      const toggle = page.locator('nav.tools').getByRole('button', {name, exact: true});
      const was = await panel.isVisible();
      for (const open of [!was, was]) {
        await toggle.click();
        assert.equal(await panel.isVisible(), open, `${name} ${open}`);
        assert.equal(await toggle.getAttribute('aria-expanded'), String(open));
      }
    },
    async closesPanel(name) {
      await t.openPanel(name);
      await t.press(`Close ${name}`);
      assert.equal(await page.locator(`#panel-${name.toLowerCase()}`).isVisible(), false);
    },
    /** The checkbox changes what the scene shows. */
    async changesScene(id) {
      await t.openPanel('View');
      await t.holdQuality();
      const box = page.locator(`#${id}`);
      await box.check();
      await waitForCamera(page);
      await waitFor(`${id} changes the scene`, async () => {
        const on = await t.sceneImage();
        await box.uncheck();
        const changed = differingShare(on, await t.sceneImage());
        await box.check();
        return changed > 2e-5 && differingShare(on, await t.sceneImage()) < changed / 2;
      });
      await t.releaseQuality();
    },
    /** Each option of the select changes the scatter plot. */
    async changesScatterPlot(label) {
      const select = page.getByLabel(label);
      const plots = new Set();
      for (let k = 0; k < await select.locator('option').count(); ++k) {
        await select.selectOption(String(k));
        plots.add(await look(() => document.querySelector('.scatter').innerHTML));
      }
      assert.ok(plots.size > 1, [...plots].join(' '));
    },
  };
}
