// Starts the animator's page.

import {h} from '../dom.js';
import {probe} from '../renderer.js';
import {LibraryPage} from './library_page.js';
import {LibrarySource} from './library_client.js';

const root = document.getElementById('app')!;
const info = probe();
if (!info) {
  root.replaceChildren(h('p', {class: 'fatal'},
    'This browser draws no WebGL 2: switch on hardware acceleration, or open the page in another one.'));
} else {
  const page = new LibraryPage(root, info, new LibrarySource(''));
  Object.assign(window, {stridewireLibrary: page});
  void page.start();
}
