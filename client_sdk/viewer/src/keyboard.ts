import type {AvatarCommands} from './avatar_commands.js';
import type {CameraControl} from './camera_control.js';
import type {CommandPanel} from './panels/command_panel.js';
import type {PlaybackControls} from './panels/playback_controls.js';
import type {Playback} from './playback.js';

/** The parts of the page that keys control. */
export interface KeyTargets {
  readonly camera: CameraControl;
  readonly commandPanel: CommandPanel;
  readonly commands: AvatarCommands;
  readonly playback: Playback;
  readonly playbackControls: PlaybackControls;
  selectNext(step: number): void;
  toggleFollow(): void;
  /**
   * Discards a pending walk. If there is none, deactivates the active tool. Without an active tool,
   * clears the selection.
   */
  escape(): void;
  spawn(): void;
  showHelp(): void;
}

/** Returns the action of each key, by its name in `KeyboardEvent.key`; letters are lower case. */
export function keyActions(targets: KeyTargets): Readonly<Record<string, () => void>> {
  const {camera, commandPanel, commands, playback, playbackControls} = targets;
  const turnRad = 0.09;
  const frameS = 1 / 30;
  return {
    ' ': () => playbackControls.toggle(),
    l: () => playback.goLive(),
    '[': () => playbackControls.changeSpeed(-1),
    ']': () => playbackControls.changeSpeed(1),
    ',': () => playbackControls.stepTime(-frameS),
    '.': () => playbackControls.stepTime(frameS),
    f: () => camera.frameAll(),
    c: () => targets.toggleFollow(),
    n: () => targets.selectNext(1),
    p: () => targets.selectNext(-1),
    Escape: () => targets.escape(),
    w: () => commandPanel.step('auto'),
    a: () => commandPanel.step('left'),
    d: () => commandPanel.step('right'),
    j: () => commandPanel.jump(),
    s: () => commandPanel.stand(),
    t: () => commandPanel.toggleTool('step'),
    m: () => commandPanel.toggleTool('walk'),
    q: () => commandPanel.nudgeTurn(5),
    e: () => commandPanel.nudgeTurn(-5),
    r: () => commandPanel.nudgeLength(0.05),
    v: () => commandPanel.nudgeLength(-0.05),
    k: () => commands.togglePlanting(),
    x: () => commands.cancel(),
    b: () => targets.spawn(),
    Delete: () => commands.remove(),
    g: () => commands.toggleRandomWalk(),
    ArrowLeft: () => camera.orbit.turn(turnRad, 0),
    ArrowRight: () => camera.orbit.turn(-turnRad, 0),
    ArrowUp: () => camera.orbit.turn(0, turnRad),
    ArrowDown: () => camera.orbit.turn(0, -turnRad),
    '+': () => camera.zoom(0.9),
    '=': () => camera.zoom(0.9),
    '-': () => camera.zoom(1.1),
    '?': () => targets.showHelp(),
  };
}

/**
 * Calls the action of each pressed key while `enabled` returns true. Keys with Ctrl, Meta or Alt,
 * and keys that the focused control uses itself, are left to the browser.
 */
export function listenToKeys(
  actions: Readonly<Record<string, () => void>>, enabled: () => boolean): void {
  addEventListener('keydown', (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey || !enabled()) return;
    const target = e.target as HTMLElement;
    const tag = target.tagName;
    if (tag === 'SELECT') return;
    if (tag === 'INPUT' && /^(text|number)$/.test((target as HTMLInputElement).type)) return;
    const isControl = tag === 'INPUT' || tag === 'BUTTON' || tag === 'SUMMARY';
    if (isControl && /^(Arrow|Home|End|Page| |Enter)/.test(e.key)) return;
    const act = actions[e.key.length === 1 ? e.key.toLowerCase() : e.key];
    if (!act) return;
    e.preventDefault();
    act();
  });
}
