// Starts the library page.

import {h} from '../dom.js';
import {detectRenderer} from '../renderer.js';
import {LibraryPage} from './library_page.js';
import {LibraryClient} from './library_client.js';

const root = document.getElementById('app')!;
const info = detectRenderer();
if (!info) {
  root.replaceChildren(h('p', {class: 'fatal'},
    'This page needs WebGL 2. Enable hardware acceleration, or use another browser.'));
} else {
  const page = new LibraryPage(root, info, new LibraryClient('.'));
  Object.assign(window, {stridewireLibrary: page});
  void page.start();
}
