// What the rotatable views draw: the data of a scene, unpacked and sent to WebGL (regl), and the shaders.
// The data are written by scene.rs: a box, lists of bodies and lines, and one stream of arrays in the order of those lists.
'use strict';
const Scene3d = (() => {
  const TOOL = [0.5, 0.53, 0.57];
  // Of a ply where nothing is known.
  const UNKNOWN = [0.72, 0.72, 0.72];

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
    const lines = (list) => list.map((one) => ({ ...one, lines: one.lines.map(points) }));
    const shades = (fields, n) => new Map(fields.map((k) => [k, take(Uint8Array, n, 1)]));
    const bodies = told.bodies.map((body) => {
      const position = points(body.points);
      const parts = body.parts.map((part) => ({ zone: part.zone, quads: take(Uint32Array, 4 * part.cells, 4) }));
      const fields = shades(body.fields, body.points);
      return { ...body, position, parts, fields, fibres: lines(body.fibres), edges: Array.from({ length: body.edges }, () => points(2)), moments: [] };
    });
    const [outlines, defects] = [lines(told.outlines), lines(told.defects)];
    const { way } = told;
    // The moments before the last: places are coarser, and there are those of the plies of the whole alone.
    const step = way ? Math.max(...size) / way.places : 0;
    const coarse = (n) => Float32Array.from(take(Uint16Array, 3 * n, 3), (v, i) => low[i % 3] + v * step);
    for (let k = 0; way && k + 1 < way.times.length; k++) {
      for (const b of way.bodies) bodies[b].moments.push({ position: coarse(bodies[b].points), fields: shades(way.fields, bodies[b].points) });
    }
    return { ...told, bodies, outlines, defects };
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

  // Faces that meet at more than this are shaded each by itself: an edge of the tool is seen as one.
  const CREASE = Math.cos((35 * Math.PI) / 180);

  // A body whose triangles have points of their own, with normals that are smooth up to its sharp edges.
  function creased(position, parts) {
    const all = parts.flatMap((p) => p.triangles);
    const corner = (i) => position.subarray(3 * i, 3 * i + 3);
    const face = all.map(([a, b, c]) => {
      const [p, q, r] = [a, b, c].map(corner);
      const [e, f] = [[0, 1, 2].map((d) => q[d] - p[d]), [0, 1, 2].map((d) => r[d] - p[d])];
      return [e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]];
    });
    const size = face.map((n) => Math.hypot(...n) || 1);
    const around = Array.from({ length: position.length / 3 }, () => []);
    all.forEach((triangle, t) => triangle.forEach((i) => around[i].push(t)));
    const points = new Float32Array(9 * all.length), normal = new Float32Array(9 * all.length);
    all.forEach((triangle, t) => triangle.forEach((i, k) => {
      const at = 9 * t + 3 * k;
      points.set(corner(i), at);
      for (const u of around[i]) {
        const along = (face[t][0] * face[u][0] + face[t][1] * face[u][1] + face[t][2] * face[u][2]) / (size[t] * size[u]);
        if (along >= CREASE || u === t) for (let d = 0; d < 3; d++) normal[at + d] += face[u][d];
      }
    }));
    let next = 0;
    const own = parts.map((p) => ({ ...p, triangles: p.triangles.map(() => [next++, next++, next++]) }));
    return { points, normal, parts: own };
  }

  // Sides of cells, each once: pairs of points; with `rim` those of one cell alone.
  function sides(parts, points, rim) {
    const count = new Map();
    for (const quads of parts) {
      for (let i = 0; i < quads.length; i += 4) {
        for (let k = 0; k < 4; k++) {
          const [a, b] = [quads[i + k], quads[i + ((k + 1) % 4)]];
          // The last corner of a triangle stands twice.
          if (a !== b) count.set(Math.min(a, b) * points + Math.max(a, b), (count.get(Math.min(a, b) * points + Math.max(a, b)) ?? 0) + 1);
        }
      }
    }
    const kept = [...count].filter(([, n]) => !rim || n === 1);
    return kept.map(([key]) => [Math.floor(key / points), key % points]);
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
        varying float at, known;
        uniform vec3 moved;
        // 0 stands for no value, 1 to 255 for places on the scale.
        void main() { face = normal; at = (place * 255.0 - 1.0) / 254.0; known = min(place * 255.0, 1.0); gl_Position = project(position + moved); }`,
      frag: `
        precision highp float;
        uniform sampler2D colours;
        uniform vec3 right, up, towards, plain;
        uniform bool coloured;
        varying vec3 face;
        varying float at, known;
        void main() {
          vec3 n = normalize(face);
          if (dot(n, towards) < 0.0) n = -n;
          float light = max(0.0, dot(n, normalize(-0.45 * right + 0.55 * up + 0.7 * towards)));
          bool shaded = coloured && known > 0.99;
          vec3 colour = shaded ? texture2D(colours, vec2(at * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb : plain;
          // Colours that stand for values keep most of their lightness.
          gl_FragColor = vec4(colour * mix(shaded ? 0.75 : 0.56, 1.0, light), 1.0);
        }`,
      attributes: {
        position: regl.prop('position'),
        normal: regl.prop('normal'),
        place: (_, { place }) => (place ? { buffer: place, normalized: true } : { constant: 0 }),
      },
      uniforms: { ...camera, colours: regl.prop('colours'), coloured: regl.prop('coloured'), plain: regl.prop('plain'), moved: regl.prop('moved'), lift: regl.prop('lift') },
      elements: regl.prop('elements'),
    });
    const line = regl({
      vert: `${PROJECT}
        attribute vec3 from, to;
        attribute vec2 corner;
        uniform vec2 pixel;
        uniform vec3 moved;
        uniform float width;
        void main() {
          vec4 a = project(from + moved), b = project(to + moved);
          vec2 along = (b.xy - a.xy) / pixel;
          along = length(along) > 0.0 ? normalize(along) : vec2(1.0, 0.0);
          vec2 off = along * (corner.x * 2.0 - 1.0) + vec2(-along.y, along.x) * corner.y;
          gl_Position = mix(a, b, corner.x) + vec4(off * 0.5 * width * pixel, 0.0, 0.0);
        }`,
      frag: 'precision highp float; uniform vec4 colour; void main() { gl_FragColor = vec4(colour.rgb * colour.a, colour.a); }',
      attributes: { from: regl.prop('from'), to: regl.prop('to'), corner: regl.prop('corner') },
      uniforms: { ...camera, width: regl.prop('width'), colour: regl.prop('colour'), moved: (_, { moved }) => moved ?? [0, 0, 0], lift: regl.prop('lift') },
      elements: regl.prop('elements'),
      depth: { enable: regl.prop('hide') },
      blend: { enable: true, func: { src: 'one', dst: 'one minus src alpha' } },
    });
    const wire = regl({
      vert: `${PROJECT} attribute vec3 position; void main() { gl_Position = project(position); }`,
      frag: 'precision highp float; uniform vec4 colour; void main() { gl_FragColor = vec4(colour.rgb * colour.a, colour.a); }',
      attributes: { position: regl.prop('position') },
      uniforms: { ...camera, colour: regl.prop('colour'), lift: regl.prop('lift') },
      elements: regl.prop('elements'),
      blend: { enable: true, func: { src: 'one', dst: 'one minus src alpha' } },
    });
    const within = regl({ context: Object.fromEntries(CAMERA.map((n) => [n, regl.prop(n)])) });
    return { surface, line, wire, within };
  }

  const once = (make) => {
    let made;
    return () => (made ??= make());
  };

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
      let parts = body.parts.map((p) => ({ zone: p.zone, quads: p.quads, triangles: triangles(p.quads) })).filter((p) => p.triangles.length);
      let [points, normal] = [body.position, null];
      // What has no field may have points more than once.
      if (!body.ply && !body.fields.size) ({ points, normal, parts } = creased(points, parts));
      const whole = body.parts.map((p) => ({ triangles: triangles(p.quads) }));
      const drawn = (pairs, position) => ribbon(pairs.map((pair) => Float32Array.from(pair.flatMap((i) => [...position.subarray(3 * i, 3 * i + 3)]))));
      const rim = (position) => once(() => drawn(sides(body.parts.map((p) => p.quads), body.points, true), position));
      return {
        ...body,
        plain: body.ply ? UNKNOWN : TOOL,
        // Where it is at the end. Made when they are asked for: most readers look at the surface alone.
        end: { normal: regl.buffer(normal ?? normals(points, parts)), position: regl.buffer(points), fields: new Map([...body.fields].map(([k, values]) => [k, regl.buffer(values)])), rim: rim(body.position) },
        moments: body.moments.map((m) => once(() => ({ normal: regl.buffer(normals(m.position, whole)), position: regl.buffer(m.position), fields: new Map([...m.fields].map(([k, values]) => [k, regl.buffer(values)])), rim: rim(m.position) }))),
        edges: once(() => ribbon(body.edges)),
        fibres: body.fibres.map((f) => ({ family: f.family, zone: f.zone, ribbon: once(() => ribbon(f.lines)) })),
        parts: parts.map((p) => ({
          zone: p.zone,
          elements: regl.elements({ data: p.triangles, type: 'uint32' }),
          mesh: once(() => regl.elements({ primitive: 'lines', data: sides([p.quads], body.points, false), type: 'uint32' })),
        })),
      };
    });
    const ribbons = (list) => list.map((one) => ({ ...one, ribbon: ribbon(one.lines) })).filter((one) => one.ribbon.from.length);
    return { ...scene, bodies, outlines: ribbons(scene.outlines), defects: ribbons(scene.defects), stripes: scene.fields.map((f) => stripe(f.stops)) };
  }

  // Reads a scene and sends it to a canvas.
  async function open(told, canvas) {
    if (!document.createElement('canvas').getContext('webgl')) throw new Error('no WebGL');
    const data = unpack(told, await inflated(told.data));
    // The buffer is kept so that a reader can save the picture.
    const regl = createREGL({ canvas, extensions: ['OES_element_index_uint'], attributes: { preserveDrawingBuffer: true } });
    return { regl, data, paint: painters(regl), scene: upload(regl, data) };
  }

  return { open };
})();
