// A check for each control of the viewer page, by name. They run in this order.

import assert from 'node:assert/strict';

import {assertNear, sharedChecks, spawnedByCard} from './controls_page.mjs';
import {differingShare, waitFor, waitForCamera} from './support.mjs';

/** The default of stridewired, which the tests use. */
const ticksPerS = 60;

/** Names of all current controls of the page: the part of the page, and the control. */
export const controlNames = (page) => page.evaluate(() => [...document.querySelectorAll(
  'button, input, select, summary, a[href], textarea, [role=application]')].map((element) => {
  const part = element.closest('section')?.id.replace('panel-', '') ??
    (element.closest('dialog') ? 'help' : element.closest('.card') ? 'card' :
      element.closest('.playback') ? 'playback' : 'page');
  if (element.classList.contains('world-button')) return 'page: world button';
  const label = element.tagName === 'CANVAS' ? 'scene' : element.id ||
    element.getAttribute('aria-label') || element.textContent;
  return `${part}: ${label.replace(/^Stop random walk.*/, 'Walk randomly')
    .replace(/^Play$/, 'Pause').replace(/^Use (dark|light) theme$/, 'Switch theme')
    .replace(/^\d+ joints$/, 'Joints')}`;
}));

/** `t` is the result of `openControlsPage`. Returns pairs of a control's name and its check. */
export function controlChecks(t) {
  const shared = sharedChecks(t);
  return [
    ...spawnChecks(t, shared), ...movementChecks(t), ...toolChecks(t, shared),
    ...queueLayerAndTerrainChecks(t, shared), ...cameraAndPlaybackChecks(t, shared),
    ...inspectorChecks(t, shared), ...appearanceChecks(t, shared), ...streamChecks(t),
    ...pageChecks(t, shared),
  ];
}

function spawnChecks(t, shared) {
  const {page, state, eventually} = t;
  const clickRandomWalk = () => page.locator('#panel-commands button.wide').click();
  return [
    [`card: Spawn ${spawnedByCard} avatars`, async () => {
      await t.press(`Spawn ${spawnedByCard} avatars`, '.card');
      await eventually('the avatars are spawned', (n) =>
        window.stridewire.worlds[0].world.avatars().length === n, spawnedByCard);
      await t.waitForRandomWalkers(spawnedByCard);
      state.avatar = (await t.avatars())[0];
      await t.waitForWalking();
      await waitFor('the card is hidden', async () => !await page.locator('.card').isVisible());
    }],
    ['commands: Walk randomly', async () => {
      await clickRandomWalk();
      await t.waitForRandomWalkers(0);
      await shared.walksRandomly(clickRandomWalk, spawnedByCard);
    }],
    ['commands: command-all', async () => {
      await page.locator('#command-all').check();
      await eventually('all avatars receive commands', (n) =>
        document.querySelector('.target').textContent === `All ${n} avatars of alpha`,
      spawnedByCard);
    }],
    ['commands: Remove', async () => {
      await t.pressCommand('Remove');
      await eventually('all avatars are removed', () =>
        window.stridewire.worlds[0].world.avatars().length === 0);
      await page.locator('#command-all').uncheck();
    }],
    ['commands: Spawn', () => shared.spawns(() => t.pressCommand('Spawn'))],
  ];
}

function movementChecks(t) {
  const requestOf = (name) => t.requestOf(() => t.pressCommand(name));
  return [
    ['commands: step-length', async () => {
      await t.setSlider('step-length', 0.5);
      assertNear((await requestOf('Step')).lengthM, 0.5);
    }],
    ['commands: turn', async () => {
      await t.setSlider('turn', 20);
      assertNear((await requestOf('Step')).turnRad, 20 * Math.PI / 180);
      await t.setSlider('turn', 0);
    }],
    ...[['Step', 'auto'], ['Left foot', 'left'], ['Right foot', 'right']].map(([name, foot]) => [
      `commands: ${name}`, async () => {
        const item = await requestOf(name);
        assert.deepEqual([item.type, item.foot], ['step', foot]);
      }]),
    ['commands: jump-length', async () => {
      await t.setSlider('jump-length', 1.2);
      assertNear((await requestOf('Jump')).lengthM, 1.2);
    }],
    ['commands: Jump', async () => assert.equal((await requestOf('Jump')).type, 'jump')],
    ['commands: stand-seconds', async () => {
      await t.setSlider('stand-seconds', 2.5);
      assertNear((await requestOf('Stand')).seconds, 2.5);
    }],
    ['commands: Stand', async () => assert.equal((await requestOf('Stand')).type, 'stand')],
  ];
}

function toolChecks(t, shared) {
  const {page, alpha, state} = t;
  return [
    ['commands: command-step-there', () =>
      shared.placesFootprints(() => page.locator('#command-step-there').click())],
    ['commands: command-exact-only', async () => {
      assert.equal(await page.locator('#command-exact-only').isVisible(), false);
      await t.makeIdle();
      await waitForCamera(page);
      await page.locator('#command-step-there').click();
      await page.locator('#command-exact-only').check();
      const rejected = [];
      const unsubscribe =
        alpha.on('event', (event) => event.type === 'rejected' && rejected.push(event));
      // No step reaches this far: the avatar stays, and the nearest reachable footprint is
      // outlined.
      const [far] = await t.pointsBeside([0.2, 1.6]);
      await page.mouse.click(far.x, far.y);
      await waitFor('the step is rejected', () => rejected.length === 1);
      unsubscribe();
      const {avatar, positionM, reason} = rejected[0];
      assert.equal(avatar, state.avatar);
      assert.match(reason, /out of reach/);
      const distanceM = Math.hypot(positionM[0] - far.at[0], positionM[2] - far.at[2]);
      assert.ok(distanceM > 0.2, `${positionM}`);
      await t.waitForOutlines(1);
      await page.locator('#command-exact-only').uncheck();
      await page.locator('#command-step-there').click();
      await t.waitForOutlines(0);
      // During a walk, the next footprint is outlined.
      const {basePositionM: [x, , z]} = await alpha.inspect(state.avatar);
      await alpha.request(
        [{avatar: state.avatar, type: 'walk', atM: [x, 0, z + 2], headingRad: 0}]);
      await t.waitForOutlines(1);
      await t.makeIdle();
      await t.waitForOutlines(0);
    }],
    ['commands: command-walk-there', () =>
      shared.sendsAvatar(() => page.locator('#command-walk-there').click())],
    ['commands: walk-x', async () => assertNear(
      (await t.walkFromField('walk-x', -1.25)).atM[0], -1.25)],
    ['commands: walk-z', async () => assertNear(
      (await t.walkFromField('walk-z', 0.75)).atM[2], 0.75)],
    ['commands: walk-heading', async () =>
      assertNear((await t.walkFromField('walk-heading', 120)).headingRad, 2 * Math.PI / 3)],
    ['commands: Start walk', async () => {
      const [x, z] = await t.look(() => ['walk-x', 'walk-z'].map(
        (id) => Number(document.getElementById(id).value)));
      const {atM} = await t.walkOf(() => page.locator('#walk-z').press('Enter'));
      assertNear(atM[0], x);
      assertNear(atM[2], z);
    }],
    ['commands: Add waypoint', async () => {
      await page.locator('#walk-x').fill('1.5');
      await t.pressCommand('Add waypoint');
      await t.waitForGoals(0, 1);
      await page.locator('#walk-x').fill('0.5');
      const {waypointsM, atM} = await t.walkOf(() => t.pressCommand('Start walk'), 1);
      assertNear(waypointsM[0][0], 1.5);
      assertNear(atM[0], 0.5);
    }],
  ];
}

function queueLayerAndTerrainChecks(t, shared) {
  const {page, alpha} = t;
  return [
    ['commands: Clear queue', () => shared.clearsQueue(() => t.pressCommand('Clear queue'))],
    ['commands: command-layer-wave', () => shared.togglesLayer('wave')],
    ['commands: command-layer-carry', () => shared.togglesLayer('carry')],
    ['commands: command-planting', () =>
      shared.togglesPlanting(() => page.locator('#command-planting').click())],
    ['commands: command-terrain', async () => {
      const names = await page.locator('#command-terrain option').evaluateAll(
        (options) => options.map(({value}) => value).filter((value) => value !== ''));
      assert.ok(names.length > 2);
      // Only the terrain may change between the images, so the avatar is idle, the quality is fixed
      // and there are no footprints that fade. The camera is far enough to show the terrain ahead.
      await t.holdQuality();
      await t.makeIdle();
      for (let i = 0; i < 8; ++i) await t.key('-');
      await waitForCamera(page);
      await t.look(() => window.stridewire.worlds[0].view.footprints.clear());
      const flat = await t.sceneImage();
      for (const name of [...names.filter((name) => name !== 'flat'), 'flat']) {
        await page.locator('#command-terrain').selectOption(name);
        await waitFor(`another client receives terrain ${name}`,
          () => (alpha.terrain === null) === (name === 'flat'));
        await waitFor(`terrain ${name} is drawn`, async () =>
          (differingShare(flat, await t.sceneImage()) > 0.003) === (name !== 'flat'));
        assert.equal(await page.locator('#command-terrain').inputValue(), name);
      }
      await t.key('f');
      await t.releaseQuality();
    }],
  ];
}

function cameraAndPlaybackChecks(t, shared) {
  const {page, look, eventually} = t;
  return [
    ['inspect: Follow', () => shared.follows(() => t.press('Follow', '#panel-inspect'))],
    ['page: Follow the selected avatar', () =>
      shared.follows(() => t.press('Follow the selected avatar'))],
    ['page: Frame all', () => shared.framesAll(() => t.press('Frame all'))],
    ['playback: Pause', () =>
      shared.pauses(() => page.locator('.playback button.round').click())],
    ['playback: Speed', async () => {
      await page.getByLabel('Speed').selectOption('0.25');
      assertNear(await look(() => window.stridewire.playback.rate), 0.25);
      const behindS = () => look(() => window.stridewire.client.renderTimeS() -
        window.stridewire.sampled()[0].timeS);
      await waitFor('playback falls behind', async () => await behindS() > 0.5);
      await look(() => window.stridewire.playback.goLive());
      await t.waitForLive();
    }],
    ['playback: scrub', async () => {
      await eventually('2 s are recorded', () =>
        Number(document.getElementById('scrub').min) <= -2);
      await t.setSlider('scrub', -1.5);
      await t.frames(2);
      const backS = await look(() => {
        const {recording} = window.stridewire.worlds[0].world;
        return recording.lastTimeS - window.stridewire.sampled()[0].timeS;
      });
      assert.ok(backS > 1.3, `${backS} s back`);
      assert.ok(await look(() => window.stridewire.playback.paused));
      await t.setSlider('scrub', 0);
      await t.waitForLive();
    }],
    ['playback: Live', () => shared.goesLive(() => t.press('Live'))],
  ];
}

function inspectorChecks(t, shared) {
  const {page, look, eventually} = t;
  return [
    ['inspect: Horizontal axis', async () => {
      await t.pauseDuringStep();
      await shared.changesScatterPlot('Horizontal axis');
    }],
    ['inspect: Vertical axis', async () => {
      await t.pauseDuringStep();
      await shared.changesScatterPlot('Vertical axis');
      // The choice stays for the next step.
      const select = page.getByLabel('Vertical axis');
      await select.selectOption('0');
      const start = await look(() => window.stridewire.inspected.movement.startTimeS);
      await look(() => window.stridewire.playback.goLive());
      await t.requestSteps();
      await eventually('the next step is inspected', (startS) =>
        window.stridewire.inspected?.movement?.parameterNames.length >= 2 &&
        window.stridewire.inspected.movement.startTimeS > startS, start);
      assert.equal(await select.inputValue(), '0');
      await look(() => window.stridewire.playback.pause());
    }],
    ['inspect: joint-labels', async () => {
      const overlayPixels = async () => {
        await t.frames(2);
        return look(() => {
          const overlay = document.querySelector('canvas.overlay');
          const {data} =
            overlay.getContext('2d').getImageData(0, 0, overlay.width, overlay.height);
          let count = 0;
          for (let i = 3; i < data.length; i += 4) if (data[i] > 0) ++count;
          return count;
        });
      };
      const without = await overlayPixels();
      await page.locator('#joint-labels').check();
      assert.ok(await overlayPixels() > without + 500);
      await page.locator('#joint-labels').uncheck();
      assert.ok(await overlayPixels() < without + 100);
    }],
    ['inspect: Joints', async () => {
      await page.locator('#panel-inspect summary').click();
      const names = await page.locator('#panel-inspect .joints li').allInnerTexts();
      assert.deepEqual(
        names, await look(() => [...window.stridewire.worlds[0].world.skeleton.names]));
    }],
  ];
}

function appearanceChecks(t, shared) {
  const {page, look, eventually} = t;
  const choose = (id) => page.locator(`label[for=${id}]`).click();
  return [
    ['view: view-shadows', () => shared.changesScene('view-shadows')],
    ['view: view-footprints', async () => {
      await look(() => window.stridewire.playback.goLive());
      const before = await look(() => window.stridewire.sampled()[0].footprints);
      await t.requestSteps();
      await eventually('there are footprints', (n) =>
        window.stridewire.sampled()[0].footprints >= n, before + 4);
      // Events arrive before the frames that show them.
      const timeS = await look(() => window.stridewire.client.serverTimeS());
      await eventually('they are drawn', (t) =>
        window.stridewire.sampled()[0].timeS >= t, timeS);
      await look(() => window.stridewire.playback.pause());
      await shared.changesScene('view-footprints');
    }],
    ['view: view-plantedFeet', async () => {
      // Both feet of an idle avatar are planted.
      await look(() => window.stridewire.playback.goLive());
      await t.makeIdle();
      await look(() => window.stridewire.playback.pause());
      await shared.changesScene('view-plantedFeet');
      await look(() => window.stridewire.playback.goLive());
    }],
    ['view: figures-lines', async () => {
      await choose('figures-lines');
      await eventually('lines are drawn', () => window.stridewire.draw.style === 'lines' &&
        document.querySelector('#panel-view .hint').textContent.startsWith('Drawing lines'));
    }],
    ['view: figures-auto', async () => {
      await choose('figures-auto');
      await eventually('the style is automatic', () =>
        window.stridewire.app.appearance.figures === 'auto' &&
        document.querySelector('#panel-view .hint').textContent.includes(
          window.stridewire.draw.style));
    }],
    ['view: figures-bodies', async () => {
      await choose('figures-lines');
      await t.frames(2);
      const lines = await look(() => window.stridewire.draw.triangles);
      await choose('figures-bodies');
      await eventually('bodies are drawn', (n) => window.stridewire.draw.style === 'bodies' &&
        window.stridewire.draw.triangles > n, lines);
    }],
    ['view: quality-low', async () => {
      await choose('quality-low');
      await eventually('the lowest level is used', () =>
        window.stridewire.draw.level === window.stridewire.draw.levels - 1 &&
        document.querySelector('.quality').hidden);
    }],
    ['view: quality-high', async () => {
      await t.frames(2);
      const low = await look(() => window.stridewire.draw.triangles);
      await choose('quality-high');
      await eventually('the finest level is used', (n) => window.stridewire.draw.level === 0 &&
        window.stridewire.draw.triangles > 2 * n && document.querySelector('.quality').hidden, low);
      assert.ok(await page.locator('#view-shadows').isChecked());
    }],
    ['view: quality-auto', async () => {
      await choose('quality-auto');
      await eventually('the quality is reduced, and the page shows that', () =>
        window.stridewire.app.appearance.quality.lowered &&
        !document.querySelector('.quality').hidden);
    }],
    ['page: Reduced quality', async () => {
      await t.press('Close View');
      await t.press('Reduced quality');
      assert.ok(await page.locator('#panel-view').isVisible());
    }],
  ];
}

function streamChecks(t) {
  const {page, eventually} = t;
  const choose = (id) => page.locator(`label[for=${id}]`).click();
  return [
    ['view: mode-full', async () => {
      const quantised = await t.measureBytesPerPose();
      await choose('mode-full');
      await waitFor('poses are larger',
        async () => await t.measureBytesPerPose() > quantised + 150);
    }],
    ['view: mode-quantised', async () => {
      const full = await t.measureBytesPerPose();
      await choose('mode-quantised');
      await waitFor('poses are smaller',
        async () => await t.measureBytesPerPose() < full - 150);
    }],
    ['view: mode-movement', async () => {
      const quantised = await t.measureBytesPerPose();
      await choose('mode-movement');
      await waitFor('poses are smaller',
        async () => await t.measureBytesPerPose() < quantised - 40);
      await eventually('the page states the mode', () =>
        document.querySelector('.status').textContent.endsWith('movement mode') &&
        document.getElementById('stream-mode').textContent.includes('sends movements'));
      await choose('mode-quantised');
      await eventually('the page states the mode', () =>
        document.querySelector('.status').textContent.endsWith('quantised mode'));
    }],
    // Columns: the detail, its flag in poses, its name in the table, and the minimum bytes saved.
    ...[
      ['root', 16, 'Quantised, root only', 70], ['reduced', 8, 'Quantised, reduced joints', 5],
      ['all', 0, 'Quantised', 0],
    ].map(([detail, flag, name, savedBytes]) => [`view: detail-${detail}`, async () => {
      const all = await t.streamCost('Quantised');
      await choose(`detail-${detail}`);
      await eventually('poses have that detail', (expected) => {
        const {pose} = window.stridewire.worlds[0].view;
        return pose.count > 0 && (pose.flags[0] & 24) === expected;
      }, flag);
      // Poses of the former detail may arrive late on a busy page, so the first measurement may
      // include some of them.
      await waitFor(`the cost of ${name} is measured`, async () => {
        const {bytesPerPose} = await t.streamCost(name, true);
        return savedBytes === 0 || bytesPerPose < all.bytesPerPose - savedBytes;
      });
    }]),
    ...[[2, 'Quantised, ½ rate'], [4, 'Quantised, ¼ rate'], [1, 'Quantised']].map(
      ([interval, name]) => [`view: rate-${interval}`, async () => {
        await choose(`rate-${interval}`);
        // A page that is busy receives poses late and many at once, so single measurements vary.
        const expected = ticksPerS / interval;
        await waitFor(`${expected} poses per second arrive`, async () => {
          const {bytesPerS, bytesPerPose} = await t.streamCost(name, true);
          return Math.abs(bytesPerS / bytesPerPose / expected - 1) < 0.3;
        });
      }]),
  ];
}

function pageChecks(t, shared) {
  const {page, state, look, eventually} = t;
  return [
    ['inspect: Deselect', async () => {
      await t.openPanel('Inspect');
      await t.press('Deselect', '#panel-inspect');
      assert.equal(await t.selectedAvatar(), 0);
    }],
    ['page: scene', async () => {
      await t.press('Frame all');
      await waitForCamera(page);
      const at = await t.clickPoint();
      await page.mouse.click(at.x, at.y);
      assert.equal(await t.selectedAvatar(), state.avatar);
    }],
    ...['Commands', 'View', 'Inspect', 'Statistics'].flatMap((name) => [
      [`page: ${name}`, () => shared.togglesPanel(name)],
      [`${name.toLowerCase()}: Close ${name}`, () => shared.closesPanel(name)],
    ]),
    ['page: Library', async () => {
      const link = await page.getByRole('link', {name: 'Library'}).getAttribute('href');
      const response = await page.request.get(new URL(link, page.url()).href);
      assert.ok(response.ok() && /<title>[^<]+</.test(await response.text()), link);
    }],
    ['page: Switch theme', async () => {
      const theme = () => look(() => document.documentElement.dataset.theme);
      const background = () => look(() => getComputedStyle(document.body).backgroundColor);
      const [themeBefore, backgroundBefore] = [await theme(), await background()];
      const toggle = page.getByRole('button', {name: /^Use (dark|light) theme$/});
      await toggle.click();
      assert.notEqual(await theme(), themeBefore);
      assert.notEqual(await background(), backgroundBefore);
      await toggle.click();
      assert.equal(await theme(), themeBefore);
    }],
    ['page: Keyboard and mouse', async () => {
      await t.press('Keyboard and mouse');
      assert.ok(await page.locator('dialog').isVisible());
    }],
    ['help: Close', async () => {
      await t.press('Close', 'dialog');
      assert.equal(await page.locator('dialog').isVisible(), false);
    }],
    ['page: world button', async () => {
      const names = () => look(() => window.stridewire.worlds.map(({name}) => name).join());
      const beta = page.locator('.world-button', {hasText: 'beta'});
      await beta.click();
      assert.equal(await names(), 'alpha,beta');
      assert.deepEqual(
        await look(() => new URLSearchParams(location.search).getAll('world').sort()),
        ['alpha', 'beta']);
      await eventually('the avatar of beta is drawn', () =>
        window.stridewire.sampled()[1].avatars.length === 1);
      await beta.click();
      assert.equal(await names(), 'alpha');
    }],
  ];
}
