import {button, h} from './dom.js';

/** The dialog that lists keys, clicks and drags. */
export function makeHelp(): HTMLDialogElement {
  const dialog = h('dialog', {class: 'help', 'aria-labelledby': 'help-title'});
  const rows: [string, string][] = [
    ['Drag, arrow keys', 'Orbit'],
    ['Wheel, pinch, + −', 'Zoom'],
    ['Shift drag, right drag, two fingers', 'Pan'],
    ['F', 'Frame all avatars'],
    ['Click, N, P', 'Select an avatar'],
    ['C, double click', 'Follow the avatar'],
    ['Esc', 'Cancel or deselect'],
    ['Space', 'Pause or play'],
    ['[ ]', 'Slower, faster'],
    [', .', 'Step back, forward in time'],
    ['L', 'Go live'],
    ['W, A, D', 'Step: next foot, left, right'],
    ['Q, E', 'Turn further left, right'],
    ['R, V', 'Longer, shorter steps'],
    ['T', 'Toggle “Step there”'],
    ['Drag an outlined footprint', 'Move that step'],
    ['M', 'Toggle “Walk there”'],
    ['M, then drag', 'Set the heading at the goal'],
    ['M, then Shift click or long touch', 'Add a waypoint'],
    ['K', 'Toggle foot planting'],
    ['J', 'Jump'],
    ['S', 'Stand'],
    ['X', 'Clear the queue'],
    ['B, Delete', 'Spawn, remove'],
    ['G', 'Toggle random walk'],
  ];
  const close = button('Close', {class: 'primary'}, () => dialog.close());
  dialog.append(
    // The browser scrolls to the focused element; focusing the title shows the dialog from its top.
    h('h2', {id: 'help-title', tabindex: -1, autofocus: true}, 'Keyboard and mouse'),
    h('p', {class: 'hint'}, 'Rings mark planted feet: green left, orange right. Footprints fade ' +
      'after 14\u00a0s. Grid lines are 1\u00a0m apart; every fifth is bold.'),
    h('dl', {class: 'keys'},
      ...rows.flatMap(([key, what]) => [h('dt', {}, key), h('dd', {}, what)])),
    close);
  return dialog;
}
