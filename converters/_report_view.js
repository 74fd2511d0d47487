// The 3D view: a camera, colours, a renderer on WebGL, one without it, and what lies under the pointer.
const View = (() => {
  const UNKNOWN = 1e30; // stands for NaN, which graphics cards need not know
  const GREY = [0.72, 0.72, 0.72], PLAIN = [0.55, 0.68, 0.8], BACK = [0.8, 0.68, 0.55];

  // --- colours ---

  function table(anchors) {
    const rgb = anchors.map((text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16)));
    const bytes = new Uint8Array(256 * 4);
    for (let i = 0; i < 256; i++) {
      const x = (i / 255) * (rgb.length - 1), k = Math.min(Math.floor(x), rgb.length - 2);
      for (let c = 0; c < 3; c++) bytes[4 * i + c] = Math.round(rgb[k][c] + (x - k) * (rgb[k + 1][c] - rgb[k][c]));
      bytes[4 * i + 3] = 255;
    }
    return bytes;
  }

  // --- camera: orthographic, turned about z and the horizontal ---

  function camera(box) {
    const home = { azimuth: -0.9, elevation: 0.5, x: 0, y: 0, zoom: 1 };
    const size = Math.max(Math.hypot(...box.size), 1e-9);
    return Object.assign({ size, home }, home);
  }

  function axes(eye) {
    const [ca, sa, ce, se] = [Math.cos(eye.azimuth), Math.sin(eye.azimuth), Math.cos(eye.elevation), Math.sin(eye.elevation)];
    return [-sa, ca, 0, -se * ca, -se * sa, ce, ce * ca, ce * sa, se]; // to the right, up, towards the eye
  }

  function scaleOf(eye, width, height) { return (eye.zoom * Math.min(width, height)) / eye.size; } // pixels per mm

  // --- WebGL: one context for all views of the page ---

  const FACE_VERTEX = `
    attribute vec3 place; attribute vec3 normal; attribute float value; attribute float fade;
    uniform mat3 turn; uniform vec3 shift; uniform vec3 scale; 
    varying vec3 across; varying float known; varying float faded;
    void main() {
      across = turn * normal; known = value;
      faded = fade;
      gl_Position = vec4((turn * place + shift) * scale, 1.0);
    }`;
  const FACE_FRAGMENT = `
    precision highp float;
    varying vec3 across; varying float known; varying float faded;
    uniform int mode; uniform vec2 range; uniform sampler2D colours;
    void main() {
      vec3 n = normalize(across);
      bool back = n.z < 0.0;
      if (back) n = -n;
      float light = 0.45 + 0.55 * clamp(0.75 * n.z + 0.3 * n.y - 0.2 * n.x, 0.0, 1.0);
      vec3 colour = back ? vec3(${BACK}) : vec3(${PLAIN});
      if (mode == 1) {
        float x = clamp((known - range.x) / (range.y - range.x), 0.0, 1.0);
        colour = known > 1e29 ? vec3(${GREY}) : texture2D(colours, vec2((x * 255.0 + 0.5) / 256.0, 0.5)).rgb;
        light = 0.72 + 0.28 * light;
      } else if (mode == 2) {
        float angle = asin(clamp(2.0 * n.z * n.y, -1.0, 1.0));
        colour = vec3(sin(angle * 24.0) > 0.0 ? 0.95 : 0.12);
        light = 0.85 + 0.15 * light;
      }
      gl_FragColor = vec4(mix(colour * light, vec3(0.97), faded * 0.86), 1.0);
    }`;
  const LINE_VERTEX = `
    attribute vec3 start; attribute vec3 end; attribute vec3 corner; // corner: 0 or 1, the side, the length along
    uniform mat3 turn; uniform vec3 shift; uniform vec3 scale; uniform vec2 pixels; uniform float width;
    varying float along;
    void main() {
      vec3 a = (turn * start + shift) * scale, b = (turn * end + shift) * scale;
      vec2 way = (b.xy - a.xy) * pixels;
      way = length(way) > 1e-6 ? normalize(way) : vec2(1.0, 0.0);
      vec3 here = mix(a, b, corner.x);
      along = corner.z;
      here.xy += (vec2(-way.y, way.x) * corner.y + way * (corner.x * 2.0 - 1.0) * 0.4) * width / pixels;
      gl_Position = vec4(here.xy, here.z - 0.004, 1.0);
    }`;
  const LINE_FRAGMENT = `
    precision highp float;
    varying float along; uniform vec3 colour; uniform vec2 dash; uniform float pixelsPerMm;
    void main() {
      if (dash.y > 0.0 && mod(along * pixelsPerMm, dash.x + dash.y) > dash.x) discard;
      gl_FragColor = vec4(colour, 1.0);
    }`;

  function webgl() {
    const canvas = document.createElement("canvas");
    const gl = canvas.getContext("webgl", { antialias: true, alpha: false });
    if (!gl || !gl.getExtension("OES_element_index_uint")) return null;
    const programs = [[FACE_VERTEX, FACE_FRAGMENT], [LINE_VERTEX, LINE_FRAGMENT]].map((sources) => {
      const program = gl.createProgram();
      sources.forEach((source, k) => {
        const shader = gl.createShader(k ? gl.FRAGMENT_SHADER : gl.VERTEX_SHADER);
        gl.shaderSource(shader, source);
        gl.compileShader(shader);
        gl.attachShader(program, shader);
      });
      gl.linkProgram(program);
      return gl.getProgramParameter(program, gl.LINK_STATUS) ? program : null;
    });
    if (!programs[0] || !programs[1]) return null;
    const [faces, lines] = programs;
    const texture = gl.createTexture();
    let loaded = null, buffers = {};

    function buffer(data, target) {
      const made = gl.createBuffer();
      gl.bindBuffer(target, made);
      gl.bufferData(target, data, gl.STATIC_DRAW);
      return made;
    }
    function load(scene) { // the buffers of one scene at a time
      if (loaded === scene) return;
      for (const old of Object.values(buffers)) (Array.isArray(old) ? old : [old]).forEach((one) => gl.deleteBuffer(one));
      buffers = {
        place: buffer(scene.places, gl.ARRAY_BUFFER), normal: buffer(scene.normals, gl.ARRAY_BUFFER),
        index: buffer(scene.triangles, gl.ELEMENT_ARRAY_BUFFER),
        line: scene.lines.map((group) => buffer(quads(group), gl.ARRAY_BUFFER)),
      };
      loaded = scene;
    }
    function quads(group) { // two triangles for each segment
      const { from, to, along, reach } = group, count = along.length, data = new Float32Array(count * 54);
      const corners = [[0, -1], [0, 1], [1, 1], [0, -1], [1, 1], [1, -1]];
      for (let i = 0; i < count; i++) {
        corners.forEach(([t, side], k) => {
          data.set(from.subarray(3 * i, 3 * i + 3), 54 * i + 9 * k);
          data.set(to.subarray(3 * i, 3 * i + 3), 54 * i + 9 * k + 3);
          data.set([t, side, t ? reach[i] : along[i]], 54 * i + 9 * k + 6);
        });
      }
      return data;
    }
    function attribute(program, name, source, size, type = gl.FLOAT, stride = 0, offset = 0) {
      const place = gl.getAttribLocation(program, name);
      if (place < 0) return;
      gl.bindBuffer(gl.ARRAY_BUFFER, source);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, type, type !== gl.FLOAT, stride, offset);
    }
    function common(program, eye, width, height) {
      const k = scaleOf(eye, width, height), m = axes(eye);
      gl.useProgram(program);
      gl.uniformMatrix3fv(gl.getUniformLocation(program, "turn"), false, [0, 3, 6, 1, 4, 7, 2, 5, 8].map((i) => m[i]));
      gl.uniform3f(gl.getUniformLocation(program, "shift"), eye.x, eye.y, 0);
      gl.uniform3f(gl.getUniformLocation(program, "scale"), (2 * k) / width, (2 * k) / height, -1 / eye.size);
      return k;
    }
    function draw(scene, eye, look, width, height) {
      if (gl.isContextLost()) return null;
      canvas.width = width; canvas.height = height;
      load(scene);
      gl.viewport(0, 0, width, height);
      gl.clearColor(1, 1, 1, 1);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
      gl.enable(gl.DEPTH_TEST);
      for (let i = 0; i < 4; i++) gl.disableVertexAttribArray(i);
      if (scene.triangles.length) {
        common(faces, eye, width, height);
        const [value, fade] = [look.values, look.faded].map((data) => buffer(data, gl.ARRAY_BUFFER));
        attribute(faces, "place", buffers.place, 3);
        attribute(faces, "normal", buffers.normal, 3, gl.SHORT, 8);
        attribute(faces, "fade", fade, 1);
        attribute(faces, "value", value, 1);
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, look.colours);
        for (const [name, kind] of [["MIN_FILTER", "LINEAR"], ["MAG_FILTER", "LINEAR"], ["WRAP_S", "CLAMP_TO_EDGE"], ["WRAP_T", "CLAMP_TO_EDGE"]])
          gl.texParameteri(gl.TEXTURE_2D, gl["TEXTURE_" + name], gl[kind]);
        gl.uniform1i(gl.getUniformLocation(faces, "mode"), look.mode);
        gl.uniform2f(gl.getUniformLocation(faces, "range"), look.range[0], look.range[1]);
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, buffers.index);
        gl.drawElements(gl.TRIANGLES, scene.triangles.length, gl.UNSIGNED_INT, 0);
        [value, fade].forEach((one) => gl.deleteBuffer(one));
      }
      for (let i = 0; i < 4; i++) gl.disableVertexAttribArray(i);
      const k = common(lines, eye, width, height);
      gl.uniform2f(gl.getUniformLocation(lines, "pixels"), width / 2, height / 2);
      scene.lines.forEach((group, g) => {
        if (!look.shown(group) || !group.along.length) return;
        const ratio = window.devicePixelRatio || 1;
        attribute(lines, "start", buffers.line[g], 3, gl.FLOAT, 36, 0);
        attribute(lines, "end", buffers.line[g], 3, gl.FLOAT, 36, 12);
        attribute(lines, "corner", buffers.line[g], 3, gl.FLOAT, 36, 24);
        gl.uniform1f(gl.getUniformLocation(lines, "width"), (group.width * ratio) / 2);
        gl.uniform3fv(gl.getUniformLocation(lines, "colour"), group.colour);
        gl.uniform2f(gl.getUniformLocation(lines, "dash"), group.dash[0], group.dash[1]);
        gl.uniform1f(gl.getUniformLocation(lines, "pixelsPerMm"), k / ratio);
        gl.drawArrays(gl.TRIANGLES, 0, group.along.length * 6);
      });
      return canvas;
    }
    return { name: "WebGL", draw };
  }

  // --- without WebGL: triangles and lines by hand into an image with depths ---

  function projected(scene, eye, width, height, places = scene.places) {
    const m = axes(eye), k = scaleOf(eye, width, height), out = new Float32Array(places.length);
    for (let i = 0; i < places.length; i += 3) {
      const [x, y, z] = [places[i], places[i + 1], places[i + 2]];
      out[i] = width / 2 + k * (m[0] * x + m[1] * y + eye.x);
      out[i + 1] = height / 2 - k * (m[3] * x + m[4] * y + m[5] * z + eye.y);
      out[i + 2] = m[6] * x + m[7] * y + m[8] * z;
    }
    return out;
  }

  function software() {
    const canvas = document.createElement("canvas"), context = canvas.getContext("2d");

    function draw(scene, eye, look, width, height) {
      canvas.width = width; canvas.height = height;
      const image = context.createImageData(width, height), pixels = image.data;
      const depth = new Float32Array(width * height).fill(-1e30);
      pixels.fill(255);
      const target = { pixels, depth, width, height };
      fill(target, scene, projected(scene, eye, width, height), eye, look);
      const k = scaleOf(eye, width, height);
      for (const group of scene.lines) if (look.shown(group)) strokes(target, scene, group, eye, k);
      context.putImageData(image, 0, 0);
      return canvas;
    }

    function fill({ pixels, depth, width, height }, scene, xyz, eye, look) {
      const { triangles, normals } = scene, m = axes(eye), colour = [0, 0, 0];
      for (let t = 0; t < triangles.length; t += 3) {
        const [a, b, c] = [triangles[t], triangles[t + 1], triangles[t + 2]];
        const [ax, ay, bx, by, cx, cy] = [xyz[3 * a], xyz[3 * a + 1], xyz[3 * b], xyz[3 * b + 1], xyz[3 * c], xyz[3 * c + 1]];
        const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
        if (Math.abs(area) < 1e-9) continue;
        const left = Math.max(0, Math.ceil(Math.min(ax, bx, cx) - 0.5)), right = Math.min(width - 1, Math.floor(Math.max(ax, bx, cx) - 0.5));
        const top = Math.max(0, Math.ceil(Math.min(ay, by, cy) - 0.5)), low = Math.min(height - 1, Math.floor(Math.max(ay, by, cy) - 0.5));
        const faded = 0.86 * look.faded[a];
        for (let y = top; y <= low; y++) {
          for (let x = left; x <= right; x++) {
            const [px, py] = [x + 0.5, y + 0.5];
            const p = ((bx - px) * (cy - py) - (cx - px) * (by - py)) / area;
            const q = ((cx - px) * (ay - py) - (ax - px) * (cy - py)) / area, r = 1 - p - q;
            if (p < -1e-6 || q < -1e-6 || r < -1e-6) continue;
            const z = p * xyz[3 * a + 2] + q * xyz[3 * b + 2] + r * xyz[3 * c + 2], place = y * width + x;
            if (z <= depth[place]) continue;
            depth[place] = z;
            shade(colour, m, look, p, q, r, normals, a, b, c);
            for (let k = 0; k < 3; k++) pixels[4 * place + k] = 255 * (colour[k] * (1 - faded) + 0.97 * faded);
          }
        }
      }
    }

    function shade(colour, m, look, p, q, r, normals, a, b, c) {
      const [nx, ny, nz] = [0, 1, 2].map((k) => p * normals[4 * a + k] + q * normals[4 * b + k] + r * normals[4 * c + k]);
      const length = Math.hypot(nx, ny, nz) || 1;
      let x = (m[0] * nx + m[1] * ny) / length, y = (m[3] * nx + m[4] * ny + m[5] * nz) / length, z = (m[6] * nx + m[7] * ny + m[8] * nz) / length;
      const back = z < 0;
      if (back) [x, y, z] = [-x, -y, -z];
      let light = 0.45 + 0.55 * Math.min(1, Math.max(0, 0.75 * z + 0.3 * y - 0.2 * x)), base = back ? BACK : PLAIN;
      if (look.mode === 1) {
        const value = p * look.values[a] + q * look.values[b] + r * look.values[c];
        const at = 4 * Math.round(255 * Math.min(1, Math.max(0, (value - look.range[0]) / (look.range[1] - look.range[0]))));
        base = value > 1e29 ? GREY : [look.colours[at] / 255, look.colours[at + 1] / 255, look.colours[at + 2] / 255];
        light = 0.72 + 0.28 * light;
      } else if (look.mode === 2) {
        const stripe = Math.sin(24 * Math.asin(Math.min(1, Math.max(-1, 2 * z * y)))) > 0 ? 0.95 : 0.12;
        base = [stripe, stripe, stripe];
        light = 0.85 + 0.15 * light;
      }
      for (let k = 0; k < 3; k++) colour[k] = base[k] * light;
    }

    function strokes({ pixels, depth, width, height }, scene, group, eye, k) {
      const from = projected(scene, eye, width, height, group.from), to = projected(scene, eye, width, height, group.to);
      const half = Math.max(0, Math.round((group.width - 1) / 2)), lift = 0.004 * eye.size, period = group.dash[0] + group.dash[1];
      for (let i = 0; i < group.along.length; i++) {
        const [ax, ay, az, bx, by, bz] = [from[3 * i], from[3 * i + 1], from[3 * i + 2], to[3 * i], to[3 * i + 1], to[3 * i + 2]];
        const steps = Math.min(4000, Math.max(1, Math.ceil(Math.max(Math.abs(bx - ax), Math.abs(by - ay)))));
        for (let s = 0; s <= steps; s++) {
          const t = s / steps, along = (group.along[i] + t * (group.reach[i] - group.along[i])) * k;
          if (group.dash[1] > 0 && along % period > group.dash[0]) continue;
          const x = Math.floor(ax + t * (bx - ax)), y = Math.floor(ay + t * (by - ay)), z = az + t * (bz - az) + lift;
          for (let v = Math.max(0, y - half); v <= Math.min(height - 1, y + half); v++) {
            for (let u = Math.max(0, x - half); u <= Math.min(width - 1, x + half); u++) {
              if (z < depth[v * width + u]) continue;
              for (let c = 0; c < 3; c++) pixels[4 * (v * width + u) + c] = 255 * group.colour[c];
            }
          }
        }
      }
    }
    return { name: "software", draw };
  }

  // --- under the pointer ---

  function picked(scene, eye, width, height, x, y) {
    const xyz = projected(scene, eye, width, height), { triangles, owners } = scene;
    let best = -1, nearest = -Infinity;
    for (let t = 0; t < triangles.length; t += 3) {
      const [a, b, c] = [3 * triangles[t], 3 * triangles[t + 1], 3 * triangles[t + 2]];
      const area = (xyz[b] - xyz[a]) * (xyz[c + 1] - xyz[a + 1]) - (xyz[c] - xyz[a]) * (xyz[b + 1] - xyz[a + 1]);
      const p = ((xyz[b] - x) * (xyz[c + 1] - y) - (xyz[c] - x) * (xyz[b + 1] - y)) / area;
      const q = ((xyz[c] - x) * (xyz[a + 1] - y) - (xyz[a] - x) * (xyz[c + 1] - y)) / area;
      if (!(p >= 0 && q >= 0 && p + q <= 1)) continue;
      const z = p * xyz[a + 2] + q * xyz[b + 2] + (1 - p - q) * xyz[c + 2];
      if (z > nearest) { nearest = z; best = owners[triangles[t]]; }
    }
    return best;
  }

  let shared = null;
  function renderer() {
    if (!shared) shared = webgl() || software();
    return shared;
  }
  function drawn(scene, eye, look, width, height) {
    let picture = renderer().draw(scene, eye, look, width, height);
    if (!picture) { // the graphics card was taken away
      shared = software();
      picture = shared.draw(scene, eye, look, width, height);
    }
    return picture;
  }
  return { UNKNOWN, table, camera, axes, scaleOf, projected, picked, drawn, renderer };
})();
