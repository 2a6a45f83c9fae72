// Canvases at the resolution of the screen, in the colours of the page.

/** The colours of the style sheet, as they are now. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["panel", "ink", "quiet", "line", "a", "b", "miss", "extra"];
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** The drawing context of a canvas, in its CSS pixels, cleared; and its size. */
export function cleared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return { context, width, height };
}

/** Red, green and blue of a colour of the style sheet, such as #aabbcc. */
export function channels(colour) {
  return [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16));
}

/** Calls `draw` once before the next picture of the screen, however often it is asked for. */
export function scheduled(draw) {
  let waits = false;
  return () => {
    if (waits) return;
    waits = true;
    requestAnimationFrame(() => {
      waits = false;
      draw();
    });
  };
}
