// Creates the WebGL renderer, and detects whether a GPU or the CPU draws.

import * as THREE from 'three';

// All colours are in display space; three.js must not convert them.
THREE.ColorManagement.enabled = false;

export interface RendererInfo {
  readonly name: string;
  /** True if the CPU draws, for example SwiftShader or llvmpipe. */
  readonly software: boolean;
}

/**
 * Detects the renderer. Uses a temporary WebGL context, because options of the real one depend on
 * the result. Returns null if the browser has no WebGL 2.
 */
export function detectRenderer(): RendererInfo | null {
  const context = document.createElement('canvas').getContext('webgl2');
  if (!context) return null;
  const extension = context.getExtension('WEBGL_debug_renderer_info');
  const name = String(context.getParameter(
    extension ? extension.UNMASKED_RENDERER_WEBGL : context.RENDERER));
  context.getExtension('WEBGL_lose_context')?.loseContext();
  return {name, software: /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name)};
}

/** Returns the canvas pixels per CSS pixel at full resolution. */
export function fullPixelRatio(info: RendererInfo): number {
  return info.software ? 1 : Math.min(devicePixelRatio || 1, 2);
}

export function makeRenderer(canvas: HTMLCanvasElement, info: RendererInfo): THREE.WebGLRenderer {
  const renderer = new THREE.WebGLRenderer({
    canvas, antialias: !info.software, stencil: true, powerPreference: 'high-performance',
  });
  renderer.autoClear = false;
  canvas.classList.toggle('software', info.software);
  renderer.setPixelRatio(fullPixelRatio(info));
  return renderer;
}
