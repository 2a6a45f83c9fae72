// Makes the mesh of every `div.viewer` rotatable. Each holds a picture, replaced by a canvas if
// there is WebGL, and its data as JSON: `positions` (f32), `faces` (u32), optional `colours` (u8)
// in base64, and `views`: cameras with x right, y down, z ahead, and their masks.
(() => {
  "use strict";

  const MESH = [0.62, 0.68, 0.75];
  const CAMERA = [0.12, 0.43, 0.86];
  const MASK = "#f08214";
  const HINT = "Drag to turn, wheel or two fingers to zoom, Shift and drag to pan, double click to reset. " +
    "Keys: arrows, + and −, Shift with arrows, 0.";
  const FREE_FIELD_OF_VIEW = 35 * Math.PI / 180;
  const AXES = [["x", [1, 0, 0]], ["−x", [-1, 0, 0]], ["y", [0, 1, 0]], ["−y", [0, -1, 0]], ["z", [0, 0, 1]], ["−z", [0, 0, -1]]];
  const CORNER = 9; // numbers of a corner: position, normal, colour
  const LINE_ENDS = 20; // of the frustum of one camera

  // Vectors are arrays of three numbers, matrices arrays of three rows.
  const sum = (a, b) => a.map((x, k) => x + b[k]);
  const times = (s, a) => a.map((x) => s * x);
  const difference = (a, b) => a.map((x, k) => x - b[k]);
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const unit = (a) => times(1 / (Math.hypot(...a) || 1), a);
  const apply = (m, a) => m.map((row) => dot(row, a));
  const transposed = (m) => [0, 1, 2].map((k) => m.map((row) => row[k]));
  const product = (m, n) => m.map((row) => apply(transposed(n), row));
  const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

  /** Rotation about a unit axis, by the right-hand rule (formula of Rodrigues). */
  function rotation(axis, angle) {
    const [c, s] = [Math.cos(angle), Math.sin(angle)];
    const moved = (a) => sum(sum(times(c, a), times(s, cross(axis, a))), times((1 - c) * dot(axis, a), axis));
    return transposed([[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(moved));
  }

  function bytes(base64) {
    const text = atob(base64);
    const array = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) array[k] = text.charCodeAt(k);
    return array.buffer;
  }

  /** Three corners per face, each as position, normal of the face and colour; and a sphere around them. */
  function triangles(positions, faces, colours) {
    const data = new Float32Array(CORNER * faces.length);
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let face = 0; face < faces.length; face += 3) {
      const corners = [0, 1, 2].map((k) => positions.subarray(3 * faces[face + k], 3 * faces[face + k] + 3));
      const [a, b, c] = corners.map((corner) => Array.from(corner));
      const normal = unit(cross(difference(b, a), difference(c, a)));
      corners.forEach((corner, k) => {
        const [at, vertex] = [CORNER * (face + k), 3 * faces[face + k]];
        data.set(corner, at);
        data.set(normal, at + 3);
        if (colours) data.set(Array.from(colours.subarray(vertex, vertex + 3), (x) => x / 255), at + 6);
        for (let axis = 0; axis < 3; axis++) {
          low[axis] = Math.min(low[axis], corner[axis]);
          high[axis] = Math.max(high[axis], corner[axis]);
        }
      });
    }
    const radius = Math.hypot(...difference(high, low)) / 2 || 1;
    return { data, centre: times(0.5, sum(low, high)), radius };
  }

  /** World coordinates of what a camera sees at pixel (x, y) at this depth. */
  function unprojected(view, x, y, depth) {
    const ray = [(x - view.centre[0]) / view.focal[0], (y - view.centre[1]) / view.focal[1], 1];
    return apply(transposed(view.rotation), difference(times(depth, ray), view.translation));
  }

  /** Ends of the lines of a frustum, with a roof over the upper edge of the image. */
  function frustum(view, depth) {
    const { width: w, height: h } = view;
    const at = (x, y) => unprojected(view, x, y, depth);
    const [eye, roof] = [unprojected(view, 0, 0, 0), at(w / 2, -h / 3)];
    const corners = [at(0, 0), at(w, 0), at(w, h), at(0, h)];
    const sides = corners.flatMap((corner, k) => [eye, corner, corner, corners[(k + 1) % 4]]);
    return [...sides, corners[0], roof, roof, corners[1]].flat();
  }

  /** Borders between pixels inside and outside of a mask, as a path in its pixels; also its size. */
  async function outline(png) {
    const image = new Image();
    image.src = `data:image/png;base64,${png}`;
    await image.decode();
    const [width, height] = [image.naturalWidth, image.naturalHeight];
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    const levels = context.getImageData(0, 0, width, height).data;
    const inside = (x, y) => levels[4 * (y * width + x)] >= 128;
    const path = new Path2D();
    const line = (x, y, toX, toY) => { path.moveTo(x, y); path.lineTo(toX, toY); };
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        if (x > 0 && inside(x, y) !== inside(x - 1, y)) line(x, y, x, y + 1);
        if (y > 0 && inside(x, y) !== inside(x, y - 1)) line(x, y, x + 1, y);
      }
    }
    return { path, width, height };
  }

  const VERTEX = `
    attribute vec3 position, normal, colour;
    uniform mat4 clip;
    uniform vec3 eye;
    varying vec3 across, towards, paint;
    void main() {
      gl_Position = clip * vec4(position, 1.0);
      across = normal;
      paint = colour;
      towards = eye - position;
    }`;
  const FRAGMENT = `
    precision highp float;
    uniform vec3 ink;
    uniform float ambient, painted;
    varying vec3 across, towards, paint;
    void main() {
      float facing = abs(dot(across, normalize(towards)));
      vec3 plain = ink * mix(facing, 1.0, ambient);
      gl_FragColor = vec4(mix(plain, paint, painted), 1.0);
    }`;

  /** Draws for all viewers of the page, because browsers allow only about sixteen WebGL contexts. */
  class Painter {
    constructor() {
      this.canvas = document.createElement("canvas");
      this.gl = this.canvas.getContext("webgl", { antialias: true });
      if (!this.gl) throw new Error("no WebGL");
      this.viewers = [];
      this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
      this.canvas.addEventListener("webglcontextrestored", () => {
        this.compile();
        for (const viewer of this.viewers) { viewer.upload(); viewer.schedule(); }
      });
      this.compile();
    }

    compile() {
      const gl = this.gl;
      this.program = gl.createProgram();
      for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
        const shader = gl.createShader(kind);
        gl.shaderSource(shader, source);
        gl.compileShader(shader);
        gl.attachShader(this.program, shader);
      }
      gl.linkProgram(this.program);
      if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(this.program));
      gl.useProgram(this.program);
      gl.enable(gl.DEPTH_TEST);
      this.at = Object.fromEntries(["clip", "eye", "ink", "ambient", "painted"].map((name) => [name, gl.getUniformLocation(this.program, name)]));
      [this.position, ...this.ofMesh] = ["position", "normal", "colour"].map((name) => gl.getAttribLocation(this.program, name));
      gl.enableVertexAttribArray(this.position);
    }

    upload(data) {
      const [gl, buffer] = [this.gl, this.gl.createBuffer()];
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      return buffer;
    }

    /** Makes the canvas fit, larger than any viewer if need be, and empties it. */
    begin(width, height, clip, eye) {
      const { gl, canvas, at } = this;
      if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
      gl.viewport(0, 0, width, height);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.uniformMatrix4fv(at.clip, false, clip);
      gl.uniform3fv(at.eye, eye);
    }

    /** In its colours as they are, which hold the light of the pictures already, or plain and shaded. */
    mesh(buffer, corners, painted) {
      const [gl, stride] = [this.gl, 4 * CORNER];
      this.use(buffer, stride, MESH, 0.25);
      gl.uniform1f(this.at.painted, painted ? 1 : 0);
      this.ofMesh.forEach((attribute, k) => {
        gl.enableVertexAttribArray(attribute);
        gl.vertexAttribPointer(attribute, 3, gl.FLOAT, false, stride, 12 * (k + 1));
      });
      gl.drawArrays(gl.TRIANGLES, 0, corners);
      gl.uniform1f(this.at.painted, 0);
      for (const attribute of this.ofMesh) gl.disableVertexAttribArray(attribute);
    }

    lines(buffer, first, count) {
      this.use(buffer, 12, CAMERA, 1);
      if (count > 0) this.gl.drawArrays(this.gl.LINES, first, count);
    }

    use(buffer, stride, ink, ambient) {
      const gl = this.gl;
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.vertexAttribPointer(this.position, 3, gl.FLOAT, false, stride, 0);
      gl.uniform3fv(this.at.ink, ink);
      gl.uniform1f(this.at.ambient, ambient);
    }
  }

  const element = (tag, properties, ...children) => {
    const made = Object.assign(document.createElement(tag), properties);
    made.append(...children);
    return made;
  };

  let scrolled = -Infinity;

  /**
   * The virtual camera turns about `pivot` (world), which it sees at `seen` (camera): p is at rotation · (p - pivot) + seen. `image` holds
   * focal lengths, principal point and size of its image, which is drawn as large as the stage allows.
   */
  class Viewer {
    constructor(box, painter) {
      const data = JSON.parse(box.querySelector("script").textContent);
      this.painter = painter;
      this.views = data.views;
      const colours = data.colours && new Uint8Array(bytes(data.colours));
      this.mesh = triangles(new Float32Array(bytes(data.positions)), new Uint32Array(bytes(data.faces)), colours);
      this.coloured = Boolean(colours);
      this.frustums = new Float32Array(this.views.flatMap((view) => frustum(view, 0.25 * this.mesh.radius)));
      this.eyes = this.views.map((view) => unprojected(view, 0, 0, 0));
      this.upload();
      this.build(box);
      this.listen();
      this.reset();
      if (data.opens !== undefined) {
        this.select.value = data.opens;
        this.enter(this.views[data.opens]);
      }
      new ResizeObserver(() => this.schedule()).observe(this.stage);
      painter.viewers.push(this);
    }

    upload() {
      this.buffers = [this.mesh.data, this.frustums].map((data) => this.painter.upload(data));
    }

    build(box) {
      const picture = box.querySelector("img");
      this.canvas = element("canvas", { tabIndex: 0, title: HINT });
      this.canvas.setAttribute("role", "img");
      this.canvas.setAttribute("aria-label", `${picture.alt} (${HINT})`);
      this.overlay = element("canvas");
      this.stage = element("div", { className: "viewer-stage" }, this.canvas, this.overlay);
      this.select = element("select", {}, new Option("Free", -1), ...this.views.map((view, k) => new Option(view.name, k)));
      this.cameras = element("input", { type: "checkbox", checked: true });
      this.colours = element("input", { type: "checkbox", checked: true });
      this.above = element("select", {}, new Option(this.views.length ? "as in the views" : "y", -1),
        ...AXES.map(([name], k) => new Option(name, k)));
      this.button = element("button", { type: "button" }, "Reset");
      const labels = [element("label", {}, "View ", this.select), element("label", {}, this.cameras, "Cameras")];
      const paint = element("label", {}, this.colours, "Colours");
      const controls = element("div", { className: "viewer-controls" },
        ...(this.views.length ? labels : []), ...(this.coloured ? [paint] : []),
        element("label", {}, "Up ", this.above), this.button);
      this.note = element("p", { className: "note" });
      this.note.setAttribute("aria-live", "polite");
      picture.replaceWith(this.stage, controls, this.note);
    }

    listen() {
      const { canvas, select } = this;
      const held = new Map();
      const release = (event) => held.delete(event.pointerId);
      canvas.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        canvas.setPointerCapture(event.pointerId);
        held.set(event.pointerId, [event.clientX, event.clientY]);
      });
      canvas.addEventListener("pointermove", (event) => {
        const [before, now] = [held.get(event.pointerId), [event.clientX, event.clientY]];
        if (!before) return;
        held.set(event.pointerId, now);
        const other = [...held].find(([id]) => id !== event.pointerId)?.[1];
        const length = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]) || 1;
        if (other) this.zoom(length(before) / length(now));
        const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
        // Each of two fingers moves their midpoint by half of its own motion.
        if (other) this.pan(dx / 2, dy / 2);
        else if (event.shiftKey) this.pan(dx, dy);
        else this.turn(dx, dy);
      });
      for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, release);
      canvas.addEventListener("dblclick", () => this.reset());
      canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
      canvas.addEventListener("keydown", (event) => this.key(event));
      select.addEventListener("change", () => (select.value < 0 ? this.leave() : this.enter(this.views[select.value])));
      for (const box of [this.cameras, this.colours]) box.addEventListener("change", () => this.schedule());
      this.button.addEventListener("click", () => this.reset());
      this.above.addEventListener("change", () => this.reset());
    }

    wheel(event) {
      // Scrolling a page should not stop at a viewer under the pointer.
      if (performance.now() - scrolled < 250) return;
      event.preventDefault();
      const pixels = event.deltaY * [1, 30, 300][event.deltaMode];
      this.zoom(Math.exp(clamp(pixels, -200, 200) / 500));
    }

    key(event) {
      const arrow = { ArrowLeft: [-20, 0], ArrowRight: [20, 0], ArrowUp: [0, -20], ArrowDown: [0, 20] }[event.key];
      if (event.ctrlKey || event.altKey || event.metaKey) return;
      if (arrow) event.shiftKey ? this.pan(...arrow) : this.turn(...arrow);
      else if (event.key === "+" || event.key === "=") this.zoom(1 / 1.1);
      else if (event.key === "-") this.zoom(1.1);
      else if (event.key === "0") this.reset();
      else return;
      event.preventDefault();
    }

    /** World direction that is up: as it was chosen, or as in most views; +y without views. */
    up() {
      if (this.above.value >= 0) return AXES[this.above.value][1];
      const ups = this.views.map((view) => times(-1, view.rotation[1]));
      const all = ups.reduce(sum, [0, 0, 0]);
      return Math.hypot(...all) > 0.1 * ups.length ? unit(all) : ups[0] ?? [0, 1, 0];
    }

    /** Shows all of the mesh from a little above, beside the first view. */
    reset() {
      const up = this.up();
      const rights = [...this.views.map((view) => view.rotation[0]), [1, 0, 0], [0, 0, 1]];
      const level = rights.map((right) => difference(right, times(dot(right, up), up)));
      const right = unit(level.find((right) => Math.hypot(...right) > 0.1));
      const upright = [right, times(-1, up), cross(right, times(-1, up))];
      this.rotation = product(rotation([1, 0, 0], 0.35), product(upright, rotation(up, -0.5)));
      this.pivot = this.mesh.centre;
      this.seen = [0, 0, 1.2 * this.mesh.radius / Math.sin(FREE_FIELD_OF_VIEW / 2)];
      const focal = 0.5 / Math.tan(FREE_FIELD_OF_VIEW / 2);
      this.image = { focal: [focal, focal], centre: [0.5, 0.5], width: 1, height: 1 };
      this.leave();
    }

    enter(view) {
      this.view = this.image = view;
      this.rotation = view.rotation;
      this.pivot = this.mesh.centre;
      this.seen = sum(apply(view.rotation, this.pivot), view.translation);
      if (view.mask && !view.outline) {
        // Later entries reuse the first promise.
        view.outline = outline(view.mask).then((made) => { view.drawn = made; this.schedule(); }, () => {});
      }
      this.note.replaceChildren(...(view.mask ? [element("span", { className: "viewer-key" }), "target mask. "] : []), view.note);
      this.schedule();
    }

    leave() {
      this.view = null;
      this.select.value = -1;
      this.note.replaceChildren("\u00a0");
      this.schedule();
    }

    /** By a way in CSS pixels: the side towards the viewer follows it. */
    turn(dx, dy) {
      if (dx === 0 && dy === 0) return;
      const up = this.up();
      const angle = Math.PI / Math.min(this.stage.clientWidth, this.stage.clientHeight);
      const yawed = product(this.rotation, rotation(up, dx * angle));
      const pitched = product(rotation([1, 0, 0], dy * angle), yawed);
      // Beyond the pole, left and right would be swapped.
      const tilt = (m) => Math.abs(dot(m[2], up));
      this.rotation = tilt(pitched) > 0.99 && tilt(pitched) > tilt(yawed) ? yawed : pitched;
      this.leave();
    }

    pan(dx, dy) {
      if (dx === 0 && dy === 0) return;
      const perPixel = this.seen[2] / this.scale();
      const step = [dx * perPixel / this.image.focal[0], dy * perPixel / this.image.focal[1], 0];
      this.pivot = difference(this.pivot, apply(transposed(this.rotation), step));
      this.leave();
    }

    zoom(factor) {
      if (factor === 1) return;
      const depth = clamp(this.seen[2] * factor, 0.02 * this.mesh.radius, 200 * this.mesh.radius);
      this.seen = times(depth / this.seen[2], this.seen);
      this.leave();
    }

    /** CSS pixels per pixel of the image. */
    scale() {
      return Math.min(this.stage.clientWidth / this.image.width, this.stage.clientHeight / this.image.height);
    }

    schedule() {
      this.frame ??= requestAnimationFrame(() => { this.frame = null; this.draw(); });
    }

    draw() {
      const [width, height] = [this.stage.clientWidth, this.stage.clientHeight];
      if (width === 0 || height === 0 || this.painter.gl.isContextLost()) return;
      const ratio = Math.min(window.devicePixelRatio, 2);
      const size = { width: Math.round(width * ratio), height: Math.round(height * ratio) };
      for (const canvas of [this.canvas, this.overlay]) Object.assign(canvas, size);
      const translation = difference(this.seen, apply(this.rotation, this.pivot));
      const eye = times(-1, apply(transposed(this.rotation), translation));
      this.painter.begin(size.width, size.height, this.clip(translation, width, height), eye);
      const painted = this.coloured && this.colours.checked;
      this.painter.mesh(this.buffers[0], this.mesh.data.length / CORNER, painted);
      if (this.cameras.checked) {
        // The frustum of the current view would be the border of the image.
        const own = this.view ? this.views.indexOf(this.view) : this.views.length;
        this.painter.lines(this.buffers[1], 0, own * LINE_ENDS);
        this.painter.lines(this.buffers[1], (own + 1) * LINE_ENDS, (this.views.length - own - 1) * LINE_ENDS);
      }
      this.canvas.getContext("2d").drawImage(this.painter.canvas, 0, 0);
      // A canvas that was only cleared may not be repainted.
      this.overlay.style.visibility = this.view ? "visible" : "hidden";
      if (this.view) this.drawOverlay(width, height, ratio);
    }

    /** Clip space from the world as WebGL wants it: column by column. */
    clip(translation, width, height) {
      const [R, image, scale] = [this.rotation, this.image, this.scale()];
      const depth = (p) => dot(R[2], p) + translation[2];
      const around = 0.5 * this.mesh.radius;
      const balls = [[this.mesh.centre, this.mesh.radius], ...this.eyes.map((eye) => [eye, around])];
      const far = Math.max(this.mesh.radius, ...balls.map(([p, r]) => depth(p) + r)) * 1.01;
      const near = Math.max(Math.min(...balls.map(([p, r]) => depth(p) - r)), 1e-3 * far);
      const x = this.offset(width, image.width, scale) + scale * image.centre[0];
      const y = this.offset(height, image.height, scale) + scale * image.centre[1];
      const K = [
        [2 * scale * image.focal[0] / width, 0, 2 * x / width - 1, 0],
        [0, -2 * scale * image.focal[1] / height, 1 - 2 * y / height, 0],
        [0, 0, (far + near) / (far - near), -2 * far * near / (far - near)],
        [0, 0, 1, 0],
      ];
      const columns = [...transposed(R), translation].map((column, k) => [...column, k === 3 ? 1 : 0]);
      return new Float32Array(columns.flatMap((column) => K.map((row) => dot(row, column) + row[3] * column[3])));
    }

    /** CSS pixels between the border of the stage and the image. */
    offset(stage, image, scale) {
      return (stage - scale * image) / 2;
    }

    drawOverlay(width, height, ratio) {
      const [view, scale] = [this.view, this.scale()];
      const context = this.overlay.getContext("2d");
      const [x, y] = [this.offset(width, view.width, scale), this.offset(height, view.height, scale)];
      const [w, h] = [scale * view.width, scale * view.height];
      context.scale(ratio, ratio);
      context.translate(x, y);
      const outside = new Path2D();
      outside.rect(-x, -y, width, height);
      outside.rect(0, 0, w, h);
      context.fillStyle = "rgba(128, 134, 140, 0.35)";
      context.fill(outside, "evenodd");
      if (!view.drawn) return;
      context.scale(w / view.drawn.width, h / view.drawn.height);
      context.lineWidth = 2 * view.drawn.width / w;
      context.lineCap = "square";
      context.strokeStyle = MASK;
      context.stroke(view.drawn.path);
    }
  }

  const boxes = document.querySelectorAll("div.viewer");
  let painter;
  try {
    painter = new Painter();
  } catch {
    return;
  }
  window.addEventListener("scroll", () => { scrolled = performance.now(); }, { passive: true });
  for (const box of boxes) {
    new Viewer(box, painter);
  }
})();
