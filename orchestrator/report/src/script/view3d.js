// The rotatable views: camera, controls, and what is drawn when (what it is made of: scene3d.js).
'use strict';
(() => {
  const HOME = { azimuth: -50, elevation: 35 };
  const PICK = [0.86, 0, 0.55];
  // Of the fibre families: told apart on every scale, and from the lines of zones by their width.
  const FIBRES = [[0.05, 0.05, 0.05], [0.0, 0.36, 0.16]];
  const rad = (degrees) => (degrees * Math.PI) / 180;
  const deg = (angle) => (angle * 180) / Math.PI;
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const between = (low, v, high) => Math.max(low, Math.min(high, v));

  class View {
    constructor(element, canvas, told, { regl, data, paint, scene }) {
      Object.assign(this, { element, canvas, told, regl, data, paint, scene });
      this.radius = Math.hypot(...told.extent.size) / 2;
      this.last = told.way ? told.way.times.length - 1 : 0;
      this.show = { tool: true, mesh: false, edges: false, fibres: new Set(), ply: new Set(), zone: new Set(), field: 0, defect: null, moment: this.last };
      this.waiting = false;
      this.linked = [];
    }

    // ---- camera: where the eye is, what it looks at, and half the height (m) that it sees ----

    // Plies and tool fill the view, wherever they are on their way.
    home(towards = HOME) {
      const low = [Infinity, Infinity], high = [-Infinity, -Infinity], mean = [0, 0, 0];
      this.eye = { ...towards, target: mean };
      const { right, up } = this.axes();
      const all = this.data.bodies.filter((b) => !b.zone).flatMap((b) => [b.position, ...b.moments.slice(0, 1).map((m) => m.position)]);
      let count = 0;
      for (const position of all) {
        for (let i = 0; i < position.length; i += 3, count++) {
          const p = position.subarray(i, i + 3);
          p.forEach((v, d) => { mean[d] += v; });
          [right, up].forEach((axis, k) => {
            const at = dot(p, axis);
            low[k] = Math.min(low[k], at);
            high[k] = Math.max(high[k], at);
          });
        }
      }
      const middle = mean.map((m) => m / count);
      const off = [right, up].map((axis, k) => (low[k] + high[k]) / 2 - dot(middle, axis));
      this.eye.target = middle.map((m, d) => m + off[0] * right[d] + off[1] * up[d]);
      const { clientWidth, clientHeight } = this.canvas;
      const [wide, tall] = [0, 1].map((k) => (high[k] - low[k]) / 2);
      this.eye.half = 1.06 * Math.max(tall, (wide * clientHeight) / Math.max(clientWidth, 1));
      this.later();
    }

    axes() {
      const [a, e] = [rad(this.eye.azimuth), rad(this.eye.elevation)];
      const [s, c, se, ce] = [Math.sin(a), Math.cos(a), Math.sin(e), Math.cos(e)];
      return { right: [-s, c, 0], up: [-se * c, -se * s, ce], towards: [ce * c, ce * s, se] };
    }

    turn(azimuth, elevation) {
      this.eye.azimuth += azimuth;
      this.eye.elevation = between(-90, this.eye.elevation + elevation, 90);
      this.later();
    }

    zoom(factor) {
      this.eye.half = between(this.radius / 200, this.eye.half / factor, 4 * this.radius);
      this.later();
    }

    move(dx, dy) {
      const { right, up } = this.axes();
      const metres = (2 * this.eye.half) / this.canvas.clientHeight;
      this.eye.target = this.eye.target.map((t, d) => t + metres * (dy * up[d] - dx * right[d]));
      this.later();
    }

    // Shows a moment of the way, the last one with the finer plies of zones.
    at(moment) {
      this.show.moment = moment;
      const slider = this.element.querySelector('input[data-moment]');
      if (slider) {
        slider.value = moment;
        this.element.querySelector('output').textContent = `${Math.round(1000 * this.told.way.times[moment])} ms`;
        slider.setAttribute('aria-valuetext', this.element.querySelector('output').textContent);
      }
      this.later();
    }

    ended() {
      return this.show.moment === this.last;
    }

    chosen() {
      return this.scene.defects.find((d) => d.id === this.show.defect);
    }

    select(id, scroll) {
      this.show.defect = id;
      const defect = this.chosen();
      if (defect) {
        this.at(this.last);
        const [x, y, z] = defect.normal;
        const far = defect.lines.flatMap((l) => [...l]).reduce((m, v, i) => Math.max(m, Math.abs(v - defect.at[i % 3])), 0);
        this.eye = {
          // Not along the normal: seen at a slant, a wrinkle has height.
          azimuth: Math.hypot(x, y) > 0.05 ? deg(Math.atan2(y, x)) + 25 : HOME.azimuth,
          elevation: between(25, deg(Math.asin(z)), 65),
          target: defect.at.slice(),
          half: Math.max(3 * far, this.radius / 20),
        };
        if (scroll) this.canvas.scrollIntoView({ block: 'nearest' });
      }
      this.later();
    }

    // ---- drawing ----

    later() {
      if (!this.waiting) requestAnimationFrame(() => this.draw());
      this.waiting = true;
      for (const other of this.linked) other.follow(this);
    }

    // Of two runs side by side: another view looks from where this one does.
    follow(other) {
      const same = JSON.stringify(this.eye) === JSON.stringify(other.eye);
      if (same) return;
      this.eye = { ...other.eye, target: other.eye.target.slice() };
      this.later();
    }

    // A chosen defect is seen on its own ply, as fine as it was found, whatever lies over it.
    showsPly(ply) {
      const chosen = this.chosen();
      return chosen ? ply === chosen.ply : this.show.ply.has(ply);
    }

    showsZone(zone) {
      return this.ended() && (this.show.zone.has(zone) || (zone !== null && this.chosen()?.zone === zone));
    }

    visible(body) {
      if (!body.ply) return this.show.tool;
      return this.showsPly(body.ply) && (!body.zone || this.showsZone(body.zone));
    }

    draw() {
      this.waiting = false;
      const { canvas, eye, radius, show, scene } = this;
      const [w, h] = [canvas.clientWidth, canvas.clientHeight];
      if (!w) return;
      const ratio = window.devicePixelRatio || 1;
      [['width', w], ['height', h]].forEach(([side, css]) => {
        if (canvas[side] !== Math.round(css * ratio)) canvas[side] = Math.round(css * ratio);
      });
      this.regl.poll();
      const scale = [h / w / eye.half, 1 / eye.half];
      const camera = { ...this.axes(), target: eye.target, depth: 4 * radius, scale, pixel: [2 / w, 2 / h] };
      this.regl.clear({ color: [0, 0, 0, 0], depth: 1 });
      this.paint.within(camera, () => {
        const tool = this.ended() ? [0, 0, 0] : this.told.way.tool[show.moment];
        for (const body of scene.bodies.filter((b) => this.visible(b))) {
          const now = this.ended() || !body.ply ? body.end : body.moments[show.moment]();
          const place = now.fields.get(show.field);
          // Where both are drawn, at the rim of a zone, the finer ply is seen.
          const lift = body.ply ? this.told.lift + (body.zone ? 0.0008 : 0) : 0;
          const moved = body.ply ? [0, 0, 0] : tool;
          const how = { place, coloured: Boolean(place), colours: scene.stripes[show.field], plain: body.plain, moved, lift };
          const parts = body.parts.filter((p) => !this.showsZone(p.zone));
          for (const part of parts) this.paint.surface({ ...now, ...part, ...how });
          if (!body.ply) {
            if (body.edges().from.length) this.paint.line({ ...body.edges(), width: 1.2, colour: [0.1, 0.12, 0.14, 0.8], hide: true, moved, lift: lift + 0.0004 });
            continue;
          }
          const over = { position: now.position, colour: [0, 0, 0, 0.45], lift: lift + 0.0006 };
          if (show.mesh) for (const part of parts) this.paint.wire({ ...over, elements: part.mesh() });
          for (const f of this.ended() ? body.fibres : []) {
            if (!show.fibres.has(String(f.family)) || this.showsZone(f.zone)) continue;
            this.paint.line({ ...f.ribbon(), width: 1.1, colour: [...FIBRES[f.family], 0.85], hide: true, lift: lift + 0.0008 });
          }
          // The finer ply of a zone ends at the zone's cut, which is no edge of the ply.
          if (show.edges && !body.zone) this.paint.line({ ...now.rim(), width: 1.8, colour: [0, 0, 0, 1], hide: true, lift: lift + 0.001 });
        }
        for (const outline of this.outlines()) this.stroke(outline.ribbon, 1.2, [0, 0, 0], 0.15);
        if (this.chosen()) this.stroke(this.chosen().ribbon, 3, PICK, 0.6);
      });
      this.labels(camera, w, h);
      this.triad(camera);
      this.element.dataset.ready = 'true';
    }

    // Of all zones, on the uppermost ply of theirs that is shown.
    outlines() {
      const shown = this.scene.outlines.filter((o) => this.ended() && this.showsPly(o.ply));
      const tops = new Map(shown.map((o) => [o.zone, o]));
      return shown.filter((o) => tops.get(o.zone) === o);
    }

    // What lies behind a surface shines through.
    stroke(ribbon, width, rgb, through) {
      const { lift } = this.told;
      this.paint.line({ ...ribbon, width, colour: [...rgb, through], hide: false, lift: 0 });
      this.paint.line({ ...ribbon, width: width + 2.5, colour: [1, 1, 1, 0.85], hide: true, lift: lift + 0.0015 });
      this.paint.line({ ...ribbon, width, colour: [...rgb, 1], hide: true, lift: lift + 0.003 });
    }

    labels({ right, up, towards, target, scale }, w, h) {
      const at = (p) => {
        const q = p.map((v, d) => v - target[d]);
        return [(dot(q, right) * scale[0] + 1) * 0.5 * w, (1 - dot(q, up) * scale[1]) * 0.5 * h];
      };
      const defect = this.chosen();
      const named = defect ? [[`${defect.label}, ${defect.ply}`, defect.at, defect.normal]] : this.outlines().map((o) => [o.zone, [...o.lines[0].subarray(0, 3)], o.normal]);
      this.element.querySelector('.labels').replaceChildren(...named.flatMap(([text, p, normal]) => {
        const [x, y] = at(p);
        if (x < 0 || y < 0 || x > w || y > h) return [];
        const span = document.createElement('span');
        span.textContent = text;
        span.style.left = `${x}px`;
        span.style.top = `${y}px`;
        // The back of the plies.
        span.classList.toggle('behind', dot(normal, towards) < 0);
        return [span];
      }));
    }

    triad({ right, up }) {
      [...this.element.querySelectorAll('.triad3d g')].forEach((g, d) => {
        const [dx, dy] = [26 * right[d], -26 * up[d]];
        for (const path of g.querySelectorAll('path')) path.setAttribute('d', `M0 0L${dx} ${dy}`);
        const name = g.querySelector('text');
        name.setAttribute('x', 1.35 * dx);
        name.setAttribute('y', 1.35 * dy + 4);
      });
    }
  }

  // ---- controls ----

  function switches(view) {
    const { element, show } = view;
    for (const box of element.querySelectorAll('input[data-show]')) {
      const change = () => {
        const kind = box.dataset.show;
        if (typeof show[kind] === 'boolean') show[kind] = box.checked;
        else if (box.checked) show[kind].add(box.value);
        else show[kind].delete(box.value);
        view.later();
      };
      box.addEventListener('change', change);
      change();
    }
    const slider = element.querySelector('input[data-moment]');
    slider?.addEventListener('input', () => {
      // A defect is one of the formed plies.
      if (view.show.defect !== null && Number(slider.value) !== view.last) document.dispatchEvent(new CustomEvent('plyflow-nothing'));
      view.at(Number(slider.value));
    });
    if (slider) view.at(view.last);
    element.querySelector('select')?.addEventListener('change', ({ target }) => {
      show.field = Number(target.value);
      for (const bar of element.querySelectorAll('.legend3d')) bar.hidden = bar.dataset.field !== target.value;
      view.later();
    });
    for (const button of element.querySelectorAll('button[data-azimuth]')) {
      const { azimuth, elevation } = button.dataset;
      button.addEventListener('click', () => view.home({ azimuth: Number(azimuth), elevation: Number(elevation) }));
    }
    element.querySelector('button[data-reset]').addEventListener('click', () => view.home());
  }

  function keysAndWheel(view) {
    const { canvas } = view;
    const keys = {
      ArrowLeft: () => view.turn(-5, 0), ArrowRight: () => view.turn(5, 0), ArrowUp: () => view.turn(0, 5), ArrowDown: () => view.turn(0, -5),
      '+': () => view.zoom(1.2), '=': () => view.zoom(1.2), '-': () => view.zoom(1 / 1.2), 0: () => view.home(),
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
      view.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.03 : 0.0015)));
    }, { passive: false });
  }

  function pointers(view) {
    const { canvas } = view;
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
        view.zoom(Math.max(span(), 1) / Math.max(before, 1));
        // Each of two fingers moves by half.
        view.move(dx / 2, dy / 2);
      } else if (event.shiftKey || event.buttons & 6) {
        view.move(dx, dy);
      } else {
        view.turn(-0.4 * dx, 0.4 * dy);
      }
    });
    for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, (event) => down.delete(event.pointerId));
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  }

  async function start(section) {
    const element = section.querySelector('.view3d');
    const canvas = element.querySelector('canvas');
    const told = JSON.parse(section.querySelector('script.scene').textContent);
    const view = new View(element, canvas, told, await Scene3d.open(told, canvas));
    section.querySelector('.without-3d').hidden = true;
    element.hidden = false;
    view.home();
    switches(view);
    keysAndWheel(view);
    pointers(view);
    document.addEventListener('plyflow-defect', ({ detail }) => view.select(detail.id, detail.scroll));
    new ResizeObserver(() => view.later()).observe(canvas);
    return view;
  }

  // Controls that mean the same in two views: by their names for people, as either may lack some.
  const named = (control) => (control.type === 'checkbox' ? `${control.dataset.show} ${control.value}` : control.tagName + control.type);

  function link(views) {
    // One home for both.
    views[1].home = (towards) => views[0].home(towards);
    views.forEach((view, k) => {
      const other = views[1 - k];
      view.linked = [other];
      const controls = (v) => [...v.element.querySelectorAll('input, select')];
      for (const control of controls(view)) {
        control.addEventListener(control.type === 'range' ? 'input' : 'change', () => {
          const twin = controls(other).find((c) => named(c) === named(control));
          if (!twin) return;
          if (control.type === 'checkbox') {
            if (twin.checked === control.checked) return;
            twin.checked = control.checked;
          } else if (control.type === 'range') {
            const at = Math.round((control.value / control.max) * twin.max);
            if (Number(twin.value) !== at) other.at(at);
            return;
          } else {
            const text = control.selectedOptions[0].textContent;
            const option = [...twin.options].find((o) => o.textContent === text);
            if (!option || twin.value === option.value) return;
            twin.value = option.value;
          }
          twin.dispatchEvent(new Event('change'));
        });
      }
    });
    views[0].home();
  }

  const started = [];
  for (const script of document.querySelectorAll('script.scene')) {
    const section = script.parentElement;
    started.push(start(section).catch((error) => {
      section.querySelector('.view3d').hidden = true;
      const text = section.querySelector('.without-3d');
      text.hidden = false;
      text.append(` (${error.message})`);
      return null;
    }));
  }
  // Views come in pairs, those of A and of B.
  if (document.body.classList.contains('beside')) {
    Promise.all(started).then((views) => {
      for (let k = 0; k + 1 < views.length; k += 2) if (views[k] && views[k + 1]) link([views[k], views[k + 1]]);
    });
  }
})();
