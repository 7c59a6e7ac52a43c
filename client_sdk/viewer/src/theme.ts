// Dark and light colours of the page and the scene. The system's preference applies until the user
// selects a theme.

import * as THREE from 'three';

import type {ViewColours} from './scene/world_view.js';

export type ThemeName = 'dark' | 'light';

const palettes = {
  dark: {
    near: '#232c3a', far: '#0f141d', line: '#3b4a60', strong: '#5b7190', sky: '#8d9db8',
    earth: '#3a3f4c', accent: '#7cc4ff', shade: '#05080d', left: '#57d0a6', right: '#ffb35c',
    shadow: 0.5,
  },
  light: {
    near: '#dfe5ec', far: '#f3f6fa', line: '#b9c4d1', strong: '#8b9bb0', sky: '#aab4c2',
    earth: '#6d6a66', accent: '#0b62c4', shade: '#26313f', left: '#0e9670', right: '#dd6f0b',
    shadow: 0.24,
  },
} as const;

export function makeColours(): ViewColours {
  return {
    lights: {
      sun: new THREE.Vector3(0.42, 0.8, 0.36).normalize(), skyLight: new THREE.Color(),
      groundLight: new THREE.Color(), fogColour: new THREE.Color(), accent: new THREE.Color(),
      shade: new THREE.Vector4(),
    },
    terrain: {
      near: new THREE.Color(), far: new THREE.Color(), line: new THREE.Color(),
      strong: new THREE.Color(),
    },
    shade: new THREE.Color(), left: new THREE.Color(), right: new THREE.Color(),
    accent: new THREE.Color(),
  };
}

/**
 * Changes the scene's colours in place, because materials share the objects. Returns the background
 * colour.
 */
export function applyTheme(name: ThemeName, colours: ViewColours): THREE.Color {
  const c = palettes[name];
  colours.terrain.near.set(c.near);
  colours.terrain.far.set(c.far);
  colours.terrain.line.set(c.line);
  colours.terrain.strong.set(c.strong);
  colours.lights.skyLight.set(c.sky);
  colours.lights.groundLight.set(c.earth);
  colours.lights.fogColour.set(c.far);
  colours.lights.accent.set(c.accent);
  colours.accent.set(c.accent);
  colours.left.set(c.left);
  colours.right.set(c.right);
  colours.shade.set(c.shade);
  colours.lights.shade.set(colours.shade.r, colours.shade.g, colours.shade.b, c.shadow);
  document.documentElement.dataset['theme'] = name;
  return colours.lights.fogColour;
}

export function preferredTheme(): ThemeName {
  const requested = new URLSearchParams(location.search).get('theme') ?? read('stridewire.theme');
  if (requested === 'dark' || requested === 'light') return requested;
  return matchMedia('(prefers-color-scheme: light)').matches ? 'light' : 'dark';
}

export function rememberTheme(name: ThemeName): void {
  try {
    localStorage.setItem('stridewire.theme', name);
  } catch {
    // The browser may forbid storage. The choice is then lost when the page closes.
  }
}

function read(key: string): string | null {
  try {
    return localStorage.getItem(key);
  } catch {
    return null;
  }
}
