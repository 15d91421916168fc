// The rotatable views: camera, controls, and what is drawn when (what it is made of: scene3d.js).
'use strict';
(() => {
  const HOME = { azimuth: -50, elevation: 35 };
  const rad = (degrees) => (degrees * Math.PI) / 180;
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  async function start(section) {
    const told = JSON.parse(section.querySelector('script.scene').textContent);
    const view = section.querySelector('.view3d');
    const canvas = view.querySelector('canvas');
    const { regl, data, paint, scene } = await Scene3d.open(told, canvas);
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

    // What lies behind a surface shines through.
    function stroke(ribbon, width, rgb, through) {
      paint.line({ ...ribbon, width, colour: [...rgb, through], hide: false, lift: 0 });
      paint.line({ ...ribbon, width: width + 2.5, colour: [1, 1, 1, 0.85], hide: true, lift: told.lift + 0.0015 });
      paint.line({ ...ribbon, width, colour: [...rgb, 1], hide: true, lift: told.lift + 0.003 });
    }

    const top = () => [...show.ply].pop();
    const chosen = () => scene.defects.find((d) => d.id === show.defect);

    function lines() {
      for (const o of scene.outlines.filter((o) => show.zone.has(o.zone) && o.ply === top())) stroke(o.ribbon, 1.2, [0, 0, 0], 0.2);
      if (chosen()) stroke(chosen().ribbon, 3, [0.86, 0, 0.55], 0.6);
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
      [...view.querySelectorAll('.triad3d g')].forEach((g, d) => {
        const [dx, dy] = [26 * right[d], -26 * up[d]];
        for (const path of g.querySelectorAll('path')) path.setAttribute('d', `M0 0L${dx} ${dy}`);
        const name = g.querySelector('text');
        name.setAttribute('x', 1.35 * dx);
        name.setAttribute('y', 1.35 * dy + 4);
      });
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
        // Not along the normal: seen at a slant, a wrinkle has height.
        eye.azimuth = Math.hypot(x, y) > 0.05 ? (Math.atan2(y, x) * 180) / Math.PI + 25 : HOME.azimuth;
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
