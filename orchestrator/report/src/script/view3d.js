// The rotatable views: formed plies, finer plies of zones and the tool, in the colours of one field, with WebGL (regl).
// The data are written by scene.rs: a box, lists of bodies and lines, and one stream of arrays in the order of those lists.
'use strict';
(() => {
  const TOOL = [0.5, 0.53, 0.57];
  const HOME = { azimuth: -50, elevation: 35 };
  const rad = (degrees) => (degrees * Math.PI) / 180;
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  // ---- data ----

  async function inflated(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
    return new Response(stream).arrayBuffer();
  }

  // Takes arrays off the stream; each number is the difference to the one `stride` before, modulo its type.
  function reader(buffer) {
    let at = 0;
    return (Type, count, stride) => {
      const end = at + count * Type.BYTES_PER_ELEMENT;
      const array = new Type(buffer.slice(at, end));
      at = end;
      for (let i = stride; i < array.length; i++) array[i] += array[i - stride];
      return array;
    };
  }

  function unpack(told, buffer) {
    const take = reader(buffer);
    const { low, size } = told.extent;
    const points = (n) => Float32Array.from(take(Uint16Array, 3 * n, 3), (v, i) => low[i % 3] + (v / 65535) * size[i % 3]);
    const bodies = told.bodies.map((body) => {
      const position = points(body.points);
      const parts = body.parts.map((part) => ({ zone: part.zone, quads: take(Uint32Array, 4 * part.cells, 4) }));
      const fields = new Map(body.fields.map((k) => [k, take(Uint8Array, body.points, 1)]));
      return { ...body, position, parts, fields };
    });
    const lines = (list) => list.map((one) => ({ ...one, lines: one.lines.map(points) }));
    return { ...told, bodies, outlines: lines(told.outlines), defects: lines(told.defects) };
  }

  function triangles(quads) {
    const out = [];
    for (let i = 0; i < quads.length; i += 4) {
      const [a, b, c, d] = quads.subarray(i, i + 4);
      out.push([a, b, c]);
      if (d !== c) out.push([a, c, d]);
    }
    return out;
  }

  // Normals at the points: sums over the triangles around them, by area.
  function normals(position, parts) {
    const normal = new Float32Array(position.length);
    for (const [a, b, c] of parts.flatMap((p) => p.triangles)) {
      const e = [0, 1, 2].map((d) => position[3 * b + d] - position[3 * a + d]);
      const f = [0, 1, 2].map((d) => position[3 * c + d] - position[3 * a + d]);
      const n = [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
      for (const i of [a, b, c]) for (let d = 0; d < 3; d++) normal[3 * i + d] += n[d];
    }
    return normal;
  }

  // Segments of lines as rectangles, to be widened on the screen.
  function ribbon(lines) {
    const from = [], to = [], corner = [], elements = [];
    for (const line of lines) {
      for (let i = 3; i < line.length; i += 3) {
        const n = from.length;
        for (const [along, side] of [[0, -1], [0, 1], [1, -1], [1, 1]]) {
          from.push([...line.subarray(i - 3, i)]);
          to.push([...line.subarray(i, i + 3)]);
          corner.push([along, side]);
        }
        elements.push([n, n + 1, n + 2], [n + 1, n + 3, n + 2]);
      }
    }
    return { from, to, corner, elements };
  }

  // ---- drawing ----

  const PROJECT = `
    precision highp float;
    uniform vec3 right, up, towards, target;
    uniform vec2 scale;
    uniform float depth, lift;
    vec4 project(vec3 p) {
      vec3 q = p - target;
      return vec4(dot(q, right) * scale.x, dot(q, up) * scale.y, -(dot(q, towards) + lift) / depth, 1.0);
    }`;

  function painters(regl) {
    const CAMERA = ['right', 'up', 'towards', 'target', 'scale', 'depth', 'pixel'];
    const camera = Object.fromEntries(CAMERA.map((n) => [n, regl.context(n)]));
    const surface = regl({
      vert: `${PROJECT}
        attribute vec3 position, normal;
        attribute float place;
        varying vec3 face;
        varying float at;
        void main() { face = normal; at = place; gl_Position = project(position); }`,
      frag: `
        precision highp float;
        uniform sampler2D colours;
        uniform vec3 right, up, towards, plain;
        uniform bool coloured;
        varying vec3 face;
        varying float at;
        void main() {
          vec3 n = normalize(face);
          if (dot(n, towards) < 0.0) n = -n;
          float light = max(0.0, dot(n, normalize(-0.45 * right + 0.55 * up + 0.7 * towards)));
          vec3 colour = coloured ? texture2D(colours, vec2(at * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb : plain;
          gl_FragColor = vec4(colour * (0.5 + 0.5 * light), 1.0);
        }`,
      attributes: {
        position: regl.prop('position'),
        normal: regl.prop('normal'),
        place: (_, { place }) => (place ? { buffer: place, normalized: true } : { constant: 0 }),
      },
      uniforms: { ...camera, colours: regl.prop('colours'), coloured: regl.prop('coloured'), plain: TOOL, lift: regl.prop('lift') },
      elements: regl.prop('elements'),
    });
    const line = regl({
      vert: `${PROJECT}
        attribute vec3 from, to;
        attribute vec2 corner;
        uniform vec2 pixel;
        uniform float width;
        void main() {
          vec4 a = project(from), b = project(to);
          vec2 along = (b.xy - a.xy) / pixel;
          along = length(along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
          vec2 off = along * (corner.x * 2.0 - 1.0) + vec2(-along.y, along.x) * corner.y;
          gl_Position = mix(a, b, corner.x) + vec4(off * 0.5 * width * pixel, 0.0, 0.0);
        }`,
      frag: 'precision highp float; uniform vec4 colour; void main() { gl_FragColor = vec4(colour.rgb * colour.a, colour.a); }',
      attributes: { from: regl.prop('from'), to: regl.prop('to'), corner: regl.prop('corner') },
      uniforms: { ...camera, width: regl.prop('width'), colour: regl.prop('colour'), lift: regl.prop('lift') },
      elements: regl.prop('elements'),
      depth: { enable: regl.prop('hide') },
      blend: { enable: true, func: { src: 'one', dst: 'one minus src alpha' } },
    });
    const within = regl({ context: Object.fromEntries(CAMERA.map((n) => [n, regl.prop(n)])) });
    return { surface, line, within };
  }

  function upload(regl, scene) {
    const stripe = (stops) => {
      const rgb = stops.map((s) => [1, 3, 5].map((i) => parseInt(s.slice(i, i + 2), 16)));
      const data = new Uint8Array(4 * 256).fill(255);
      for (let i = 0; i < 256; i++) {
        const t = (i / 255) * (rgb.length - 1), k = Math.min(Math.floor(t), rgb.length - 2);
        for (let c = 0; c < 3; c++) data[4 * i + c] = Math.round(rgb[k][c] + (rgb[k + 1][c] - rgb[k][c]) * (t - k));
      }
      return regl.texture({ width: 256, height: 1, data, mag: 'linear', min: 'linear' });
    };
    const bodies = scene.bodies.map((body) => {
      const parts = body.parts.map((p) => ({ zone: p.zone, triangles: triangles(p.quads) })).filter((p) => p.triangles.length);
      return {
        ...body,
        normal: regl.buffer(normals(body.position, parts)),
        position: regl.buffer(body.position),
        parts: parts.map((p) => ({ zone: p.zone, elements: regl.elements({ data: p.triangles, type: 'uint32' }) })),
        fields: new Map([...body.fields].map(([k, values]) => [k, regl.buffer(values)])),
      };
    });
    const ribbons = (list) => list.map((one) => ({ ...one, ribbon: ribbon(one.lines) })).filter((one) => one.ribbon.from.length);
    return { ...scene, bodies, outlines: ribbons(scene.outlines), defects: ribbons(scene.defects), stripes: scene.fields.map((f) => stripe(f.stops)) };
  }

  // ---- one view ----

  async function start(section) {
    const told = JSON.parse(section.querySelector('script.scene').textContent);
    const view = section.querySelector('.view3d');
    const canvas = view.querySelector('canvas');
    const data = unpack(told, await inflated(told.data));
    // The buffer is kept so that a reader can save the picture.
    const regl = createREGL({ canvas, extensions: ['OES_element_index_uint'], attributes: { preserveDrawingBuffer: true } });
    const paint = painters(regl);
    const scene = upload(regl, data);
    const { low, size } = told.extent;
    const plies = data.bodies.filter((b) => b.ply && !b.zone);
    const middle = low.map((v, d) => v + size[d] / 2);
    const radius = Math.hypot(...size) / 2;
    const show = { tool: true, ply: new Set(), zone: new Set(), field: 0, defect: null };
    const eye = {};
    let waiting = false;

    // The plies fill the view; the tool may reach out of it.
    function home() {
      Object.assign(eye, HOME, { target: middle.slice() }, { half: radius });
      const { right, up } = axes();
      const reach = [0, 0], mean = [0, 0, 0];
      let count = 0;
      for (const { position } of plies) {
        for (let i = 0; i < position.length; i += 3, count++) for (let d = 0; d < 3; d++) mean[d] += position[i + d];
      }
      eye.target = mean.map((m) => m / count);
      for (const { position } of plies) {
        for (let i = 0; i < position.length; i += 3) {
          const q = eye.target.map((t, d) => position[i + d] - t);
          [right, up].forEach((axis, k) => { reach[k] = Math.max(reach[k], Math.abs(dot(q, axis))); });
        }
      }
      eye.half = 1.08 * Math.max(reach[1], reach[0] * (canvas.clientHeight / Math.max(canvas.clientWidth, 1)));
    }

    function axes() {
      const [a, e] = [rad(eye.azimuth), rad(eye.elevation)];
      const [s, c, se, ce] = [Math.sin(a), Math.cos(a), Math.sin(e), Math.cos(e)];
      return { right: [-s, c, 0], up: [-se * c, -se * s, ce], towards: [ce * c, ce * s, se] };
    }

    const visible = (body) => (body.ply ? show.ply.has(body.ply) && (!body.zone || show.zone.has(body.zone)) : show.tool);

    function draw() {
      waiting = false;
      const [w, h] = [canvas.clientWidth, canvas.clientHeight];
      if (!w) return;
      const ratio = window.devicePixelRatio || 1;
      if (canvas.width !== Math.round(w * ratio)) canvas.width = Math.round(w * ratio);
      if (canvas.height !== Math.round(h * ratio)) canvas.height = Math.round(h * ratio);
      regl.poll();
      const camera = { ...axes(), target: eye.target, depth: 4 * radius, scale: [h / w / eye.half, 1 / eye.half], pixel: [2 / w, 2 / h] };
      regl.clear({ color: [0, 0, 0, 0], depth: 1 });
      paint.within(camera, () => {
        for (const body of scene.bodies.filter(visible)) {
          const place = body.fields.get(show.field);
          for (const part of body.parts.filter((p) => !show.zone.has(p.zone))) {
            paint.surface({ ...body, ...part, place, coloured: Boolean(place), colours: scene.stripes[show.field], lift: body.ply ? told.lift : 0 });
          }
        }
        lines();
      });
      labels(camera, w, h);
      view.dataset.ready = 'true';
    }

    function stroke(ribbon, width, rgb) {
      const [black, white] = [[...rgb, 1], [1, 1, 1, 0.85]];
      // What lies behind a surface shines through.
      paint.line({ ...ribbon, width, colour: [...rgb, 0.3], hide: false, lift: 0 });
      paint.line({ ...ribbon, width: width + 2.5, colour: white, hide: true, lift: told.lift + 0.0015 });
      paint.line({ ...ribbon, width, colour: black, hide: true, lift: told.lift + 0.003 });
    }

    const top = () => [...show.ply].pop();
    const chosen = () => scene.defects.find((d) => d.id === show.defect);

    function lines() {
      for (const o of scene.outlines.filter((o) => show.zone.has(o.zone) && o.ply === top())) stroke(o.ribbon, 1.2, [0, 0, 0]);
      if (chosen()) stroke(chosen().ribbon, 3, [0.86, 0, 0.55]);
    }

    function labels({ right, up, target, scale }, w, h) {
      const at = (p) => [right, up].map((axis, k) => (dot(p.map((v, d) => v - target[d]), axis) * scale[k] * (k ? -1 : 1) + 1) / 2 * [w, h][k]);
      const outlines = scene.outlines.filter((o) => show.zone.has(o.zone) && o.ply === top() && !show.defect);
      const texts = outlines.map((o) => [o.zone, [...o.lines[0].subarray(0, 3)]]);
      if (chosen()) texts.push([chosen().label, chosen().at]);
      view.querySelector('.labels').replaceChildren(...texts.flatMap(([text, p]) => {
        const [x, y] = at(p);
        if (x < 0 || y < 0 || x > w || y > h) return [];
        const span = document.createElement('span');
        span.textContent = text;
        span.style.left = `${x}px`;
        span.style.top = `${y}px`;
        return [span];
      }));
    }

    function later() {
      if (!waiting) requestAnimationFrame(draw);
      waiting = true;
    }

    function turn(azimuth, elevation) {
      eye.azimuth += azimuth;
      eye.elevation = Math.max(-90, Math.min(90, eye.elevation + elevation));
      later();
    }

    function zoom(factor) {
      eye.half = Math.max(radius / 200, Math.min(4 * radius, eye.half / factor));
      later();
    }

    function move(dx, dy) {
      const { right, up } = axes();
      const metres = (2 * eye.half) / canvas.clientHeight;
      eye.target = eye.target.map((t, d) => t + metres * (dy * up[d] - dx * right[d]));
      later();
    }

    function select(id, scroll) {
      show.defect = id;
      const defect = chosen();
      if (defect) {
        const [x, y, z] = defect.normal;
        eye.azimuth = Math.hypot(x, y) > 0.05 ? (Math.atan2(y, x) * 180) / Math.PI : HOME.azimuth;
        // Not along the normal: seen at a slant, a wrinkle has height.
        eye.elevation = Math.max(25, Math.min(65, (Math.asin(z) * 180) / Math.PI));
        eye.target = defect.at.slice();
        const far = defect.lines.flatMap((l) => [...l]).reduce((m, v, i) => Math.max(m, Math.abs(v - defect.at[i % 3])), 0);
        eye.half = Math.max(3 * far, radius / 20);
        if (scroll) canvas.scrollIntoView({ block: 'nearest' });
      }
      later();
    }

    controls({ view, canvas, show, turn, zoom, move, later, eye, home });
    document.addEventListener('plyflow-defect', ({ detail }) => select(detail.id, detail.scroll));
    section.querySelector('.without-3d').hidden = true;
    view.hidden = false;
    home();
    new ResizeObserver(later).observe(canvas);
    later();
  }

  function controls({ view, canvas, show, turn, zoom, move, later, eye, home }) {
    for (const box of view.querySelectorAll('input[data-show]')) {
      const change = () => {
        const { show: kind } = box.dataset;
        if (kind === 'tool') show.tool = box.checked;
        else if (box.checked) show[kind].add(box.value);
        else show[kind].delete(box.value);
        later();
      };
      box.addEventListener('change', change);
      change();
    }
    view.querySelector('select')?.addEventListener('change', ({ target }) => {
      show.field = Number(target.value);
      for (const bar of view.querySelectorAll('.legend3d')) bar.hidden = bar.dataset.field !== target.value;
      later();
    });
    for (const button of view.querySelectorAll('button[data-azimuth]')) {
      button.addEventListener('click', () => {
        home();
        eye.azimuth = Number(button.dataset.azimuth);
        eye.elevation = Number(button.dataset.elevation);
        later();
      });
    }
    const reset = () => { home(); later(); };
    view.querySelector('button[data-reset]').addEventListener('click', reset);
    const keys = {
      ArrowLeft: () => turn(-5, 0), ArrowRight: () => turn(5, 0), ArrowUp: () => turn(0, 5), ArrowDown: () => turn(0, -5),
      '+': () => zoom(1.2), '=': () => zoom(1.2), '-': () => zoom(1 / 1.2), 0: reset,
    };
    canvas.addEventListener('keydown', (event) => {
      if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      keys[event.key]();
    });
    canvas.addEventListener('wheel', (event) => {
      // A page is scrolled past a view that nobody has clicked on.
      if (document.activeElement !== canvas) return;
      event.preventDefault();
      zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.03 : 0.0015)));
    }, { passive: false });
    pointers({ canvas, turn, zoom, move });
  }

  function pointers({ canvas, turn, zoom, move }) {
    const down = new Map();
    const span = () => {
      const [a, b] = [...down.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      down.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener('pointermove', (event) => {
      const last = down.get(event.pointerId);
      if (!last) return;
      const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
      const before = down.size === 2 ? span() : 0;
      down.set(event.pointerId, [event.clientX, event.clientY]);
      if (down.size === 2) {
        zoom(span() / Math.max(before, 1));
        // Each of two fingers moves by half.
        move(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons & 6) {
        move(dx, dy);
      } else {
        turn(-0.4 * dx, 0.4 * dy);
      }
    });
    for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, (event) => down.delete(event.pointerId));
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  }

  for (const script of document.querySelectorAll('script.scene')) {
    start(script.parentElement).catch((error) => {
      const text = script.parentElement.querySelector('.without-3d');
      script.parentElement.querySelector('.view3d').hidden = true;
      text.hidden = false;
      text.append(` (${error.message})`);
    });
  }
})();
