// Starts the page and hands browser tests what they look at.

import {App} from './app.js';
import {h} from './dom.js';
import {probe} from './renderer.js';

const root = document.getElementById('app')!;
const info = probe();
if (!info) {
  root.replaceChildren(h('p', {class: 'fatal'},
    'This browser draws no WebGL 2: switch on hardware acceleration, or open the page in another one.'));
} else {
  // ?server=host:port looks at another server than the one this page came from.
  const asked = new URLSearchParams(location.search).get('server');
  const app = new App(root, info, {
    host: asked && /^[\w.\-[\]:]+$/.test(asked) ? asked : location.host,
    secure: location.protocol === 'https:',
  });
  app.start();
  Object.assign(window, {
    stridewire: {
      app,
      client: app.client,
      get worlds() {
        return app.shown.map(({world, view}) => ({name: world.name, world, view}));
      },
      renderer: info,
      get draw() {
        return app.drawInfo;
      },
      get stats() {
        return {
          ...app.client.statistics, ...app.liveFigures, framesDrawn: app.framesDrawn,
          frameMs: app.frameMs, firstFigureMs: app.firstFigureMs};
      },
      get playback() {
        return app.playback;
      },
      get selection() {
        return app.selection;
      },
      get inspected() {
        return app.inspected;
      },
      /** Where an avatar's root is on the page, to click it; null when it is not seen. */
      place(world: string, avatar: number) {
        return app.onPage(world, avatar);
      },
      /** Poses as drawn in the last frame: a copy, by world. */
      sampled() {
        return app.shown.map(({world, view}) => ({
          world: world.name,
          timeS: app.drawnTimeS,
          avatars: [...view.pose.avatars.subarray(0, view.pose.count)],
          rootsM: [...view.pose.rootsM.subarray(0, view.pose.count * 3)],
          jointsM: view.crowd ? [...view.crowd.positions.subarray(
            0, view.crowd.count * view.crowd.skeleton.jointCount * 3)] : [],
          footprints: view.footprints.laid,
          planned: view.plannedCount,
          goals: view.goalCount,
          waypoints: view.waypointCount,
        }));
      },
    },
  });
}
