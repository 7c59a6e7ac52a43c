// Starts the viewer page, and defines `window.stridewire` for browser tests, see README.md.

import {App} from './app.js';
import {h} from './dom.js';
import {detectRenderer} from './renderer.js';

const root = document.getElementById('app')!;
const info = detectRenderer();
if (!info) {
  root.replaceChildren(h('p', {class: 'fatal'},
    'This page needs WebGL 2. Enable hardware acceleration, or use another browser.'));
} else {
  // ?server=host:port connects to a server other than the one that served this page.
  const server = new URLSearchParams(location.search).get('server');
  let app: App;
  try {
    app = new App(root, info, {
      // The folder of this page, which may be below a path prefix of a proxy.
      host: server && /^[\w.\-[\]:]+$/.test(server) ? server :
        location.host + location.pathname.replace(/\/[^/]*$/, ''),
      secure: location.protocol === 'https:',
    });
  } catch (error) {
    root.replaceChildren(h('p', {class: 'fatal'},
      `This page cannot start: ${error instanceof Error ? error.message : String(error)}`));
    throw error;
  }
  app.start();
  Object.assign(window, {
    stridewire: {
      app,
      client: app.client,
      get worlds() {
        return app.panes.map(({world, view}) => ({name: world.name, world, view}));
      },
      renderer: info,
      get draw() {
        return app.drawInfo;
      },
      get stats() {
        return {
          ...app.client.statistics, ...app.liveStatistics, framesDrawn: app.framesDrawn,
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
      /** Returns the position of an avatar's root in CSS pixels, or null if it is not visible. */
      place(world: string, avatar: number) {
        return app.avatarOnPage(world, avatar);
      },
      /** Returns copies of the poses that the last frame shows, one entry per world. */
      sampled() {
        return app.panes.map(({world, view}) => ({
          world: world.name,
          timeS: app.drawnTimeS,
          avatars: [...view.pose.avatars.subarray(0, view.pose.count)],
          rootsM: [...view.pose.rootsM.subarray(0, view.pose.count * 3)],
          jointsM: view.crowd ? [...view.crowd.positions.subarray(
            0, view.crowd.count * view.crowd.skeleton.jointCount * 3)] : [],
          footprints: view.footprints.addedCount,
          planned: view.plannedCount,
          goals: view.goalCount,
          waypoints: view.waypointCount,
        }));
      },
    },
  });
}
