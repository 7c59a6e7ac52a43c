import {button, h} from './dom.js';

/** What keys, clicks and drags do, by key. */
export function makeHelp(): HTMLDialogElement {
  const dialog = h('dialog', {class: 'help', 'aria-labelledby': 'help-title'});
  const rows: [string, string][] = [
    ['Drag, arrow keys', 'orbit'], ['Wheel, pinch, + −', 'zoom'],
    ['Shift or right drag, two fingers', 'move the view'], ['F', 'frame all'],
    ['C, double click', 'follow'], ['Click, N, P', 'choose a figure'], ['Esc', 'deselect'],
    ['Space', 'pause'], ['[ ]', 'slower, faster'], [', .', 'a moment back, on'], ['L', 'live'],
    ['W, A, D', 'step: next foot, left, right'], ['Q, E', 'turn more left, right'],
    ['R, V', 'longer, shorter steps'], ['Drag an outlined print', 'moves that step'],
    ['T', 'clicks on the ground are footprints'], ['M', 'clicks on the ground send there'],
    ['M, then drag', 'the way to look there'], ['M, then Shift click, long touch', 'a place to pass first'],
    ['K', 'feet stand still, or slide'], ['J', 'jump'], ['S', 'stand'], ['X', 'clear the queue'],
    ['B, Delete', 'spawn, remove'], ['G', 'let them wander'],
  ];
  const close = button('Close', {class: 'primary'}, () => dialog.close());
  dialog.append(
    // What is focused is scrolled to: the beginning.
    h('h2', {id: 'help-title', tabindex: -1, autofocus: true}, 'Keys'),
    h('p', {class: 'hint'}, 'Rings mark feet that carry: green the left, orange the right; ' +
      'footprints fade after 14 s. Lines on the ground are a metre apart, strong ones five.'),
    h('dl', {class: 'keys'}, ...rows.flatMap(([key, what]) => [h('dt', {}, key), h('dd', {}, what)])),
    close);
  return dialog;
}
