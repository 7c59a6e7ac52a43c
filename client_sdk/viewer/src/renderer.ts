// The WebGL renderer, and whether a processor or a graphics card does its work.

import * as THREE from 'three';

THREE.ColorManagement.enabled = false;  // Colours are given, and written, as they are displayed.

export interface RendererInfo {
  readonly name: string;
  readonly software: boolean;
}

/** Asks a context of its own: the real one is made to suit the answer. Null without WebGL 2. */
export function probe(): RendererInfo | null {
  const context = document.createElement('canvas').getContext('webgl2');
  if (!context) return null;
  const extension = context.getExtension('WEBGL_debug_renderer_info');
  const name = String(context.getParameter(
    extension ? extension.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  context.getExtension('WEBGL_lose_context')?.loseContext();
  return {name, software: /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name)};
}

/** Canvas pixels a CSS pixel at the finest. */
export function basePixelRatio(info: RendererInfo): number {
  return info.software ? 1 : Math.min(devicePixelRatio || 1, 2);
}

export function makeRenderer(canvas: HTMLCanvasElement, info: RendererInfo): THREE.WebGLRenderer {
  const renderer = new THREE.WebGLRenderer({
    canvas, antialias: !info.software, stencil: true, powerPreference: 'high-performance',
  });
  renderer.autoClear = false;
  canvas.classList.toggle('exact', info.software);
  renderer.setPixelRatio(basePixelRatio(info));
  return renderer;
}
