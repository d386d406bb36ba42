'use strict';

/** Bytes that travel compressed in the page. */
async function unpack(id) {
  const packed = atob(document.getElementById(id).textContent);
  const bytes = new Uint8Array(packed.length);
  for (let k = 0; k < packed.length; k++) bytes[k] = packed.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Response(stream).arrayBuffer();
}

/** Gives each link of the drawing the colour of its joint's error, on the scale from the least to the greatest of these, N m. */
function paintRobot(errors) {
  const ranked = [...errors].filter(([, rms]) => Number.isFinite(rms)).sort((a, b) => a[1] - b[1]);
  if (!ranked.length) return;
  const [least, most] = [ranked[0], ranked.at(-1)];
  // Errors that are about the same look about the same.
  const start = Math.min(least[1], 0.8 * most[1]);
  for (const link of document.querySelectorAll('#robot [data-joint]')) {
    const rms = errors.get(link.dataset.joint);
    if (!Number.isFinite(rms)) continue;
    const share = Math.round(100 * (rms - start) / (most[1] - start || 1));
    link.style.color = `color-mix(in oklab, var(--heat-most) ${share}%, var(--heat-least))`;
    link.querySelector('title').textContent = `${link.dataset.joint}: ${rms.toFixed(3)} N m`;
  }
  const words = { start: `least: ${least[0]}, ${Number(least[1].toPrecision(3))}`, end: `most: ${most[0]}, ${Number(most[1].toPrecision(3))}\u00a0N\u00a0m\u00a0rms` };
  for (const [key, text] of Object.entries(words)) {
    const place = document.getElementById(`scale-${key}`);
    if (place) place.textContent = text;
  }
}

function paintRobotAsWritten() {
  const links = [...document.querySelectorAll('#robot [data-rms]')].filter((link) => link.dataset.rms);
  paintRobot(new Map(links.map((link) => [link.dataset.joint, Number(link.dataset.rms)])));
}

/** The solver: fits the limbs' models under any choice of their effects. */
async function startSolver(limbs) {
  const [code, numbers, drawn] = await Promise.all(['solver', 'factors', 'drawn'].map(unpack));
  const { instance: { exports: wasm } } = await WebAssembly.instantiate(code);
  const factors = new Float64Array(numbers);
  const at = wasm.input(factors.length);
  new Float64Array(wasm.memory.buffer, at, factors.length).set(factors);
  if (wasm.load() !== limbs.length) throw new Error('the factors cannot be read');
  let next = 0;
  const rows = new Float32Array(drawn);
  const windows = limbs.map((limb) => limb.joints.map((_, j) => {
    const width = 6 + Math.max(...limb.places[j]);
    const from = next;
    next += width * limb.drawn[j];
    return Array.from({ length: limb.drawn[j] }, (_, k) => rows.subarray(from + width * k, from + width * (k + 1)));
  }));
  /** Sums of squares of each joint, and θ of each fold. */
  function fit(n, there) {
    const { joints: { length: joints }, folds, effects } = limbs[n];
    effects.forEach((_, k) => wasm.choose(n, k, there[k] ? 1 : 0));
    const length = wasm.solve(n);
    if (!length) throw new Error('this model cannot be fitted');
    const answer = new Float64Array(wasm.memory.buffer, wasm.output(), length).slice();
    const entries = (length - folds * joints) / folds;
    const squares = Array.from({ length: joints }, (_, j) => {
      let sum = 0;
      for (let f = 0; f < folds; f++) sum += answer[f * joints + j];
      return sum;
    });
    const theta = Array.from({ length: folds }, (_, f) => answer.subarray(folds * joints + f * entries, folds * joints + (f + 1) * entries));
    return { squares, theta };
  }
  /** What a fit leaves of each drawn window of a joint: measured less predicted torque. */
  function residuals(n, j, { theta }) {
    const places = limbs[n].places[j];
    const own = theta.map((numbers) => {
      const of = new Float64Array(1 + Math.max(...places));
      places.forEach((place, e) => { if (place >= 0) of[place] += numbers[e]; });
      return of;
    });
    return windows[n][j].map((row) => own[row[3]].reduce((rest, number, c) => rest - number * row[5 + c], row[4]));
  }
  return { fit, residuals, windows };
}

/** Means over equal ranges of x, and their errors by visits: samples of one visit to a range are not independent. */
function binned(x, y, bins = 20) {
  const least = Math.min(...x);
  const width = (Math.max(...x) - least) / bins;
  if (!(width > 0)) return { x: [], y: [], error: [] };
  const visits = Array.from({ length: bins }, () => []);
  let before = -1;
  x.forEach((value, k) => {
    const bin = Math.min(bins - 1, Math.floor((value - least) / width));
    if (bin !== before) visits[bin].push([0, 0]);
    const visit = visits[bin].at(-1);
    visit[0] += 1;
    visit[1] += y[k];
    before = bin;
  });
  const result = { x: [], y: [], error: [] };
  visits.forEach((own, bin) => {
    const n = own.reduce((sum, visit) => sum + visit[0], 0);
    if (n < 5 || own.length < 2) return;
    const mean = own.reduce((sum, visit) => sum + visit[1], 0) / n;
    const squares = own.reduce((sum, visit) => sum + (visit[1] - visit[0] * mean) ** 2, 0);
    result.x.push(least + (bin + 0.5) * width);
    result.y.push(mean);
    result.error.push(2 * Math.sqrt(own.length / (own.length - 1) * squares) / n);
  });
  return result;
}

/** An element with text and children. */
function make(name, properties = {}, ...children) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children);
  return element;
}

/** Tick boxes, errors and residuals that follow them. */
async function startChoices(specs, draw) {
  const written = document.getElementById('choices');
  if (!written) return;
  const { limbs, floor, first, compare, rms: told } = JSON.parse(written.textContent);
  const solver = await startSolver(limbs);
  const joints = limbs.flatMap((limb, n) => limb.joints.map((name, j) => ({ name, n, j, windows: limb.windows[j], floor: limb.floor[j] })));
  const as = (key) => limbs.map((limb) => limb.effects.map((effect) => effect[key]));
  let ticked = as('found');
  const fitAll = (there) => limbs.map((_, n) => solver.fit(n, there[n]));
  const found = fitAll(ticked);
  const before = fitAll(as('before'));
  let now = [...found];
  const errorOf = (fits, { n, j, windows }) => Math.sqrt(fits[n].squares[j] / Math.max(1, windows));
  const errorOfAll = (fits) => {
    const sum = joints.reduce((sum, joint) => sum + fits[joint.n].squares[joint.j], 0);
    return Math.sqrt(sum / Math.max(1, joints.reduce((sum, joint) => sum + joint.windows, 0)));
  };
  const most = Math.max(...joints.map((joint) => errorOf(before, joint)), ...joints.map((joint) => errorOf(found, joint)));
  const get = (id) => document.getElementById(id);

  // Where the torque is not linear in an effect, the page's error is that of a straight line at the model's fit.
  const fixed = limbs.flatMap((limb) => limb.fixed);
  const off = Math.abs(errorOfAll(found) - told);
  const words = [];
  if (fixed.length) words.push(`Always in the model, since the torque is not linear in them: ${[...new Set(fixed)].join(', ')}.`);
  if (off > 1e-6) words.push(`For the model as found proprio compare prints ${told.toFixed(4)} N m: this page fits the bodies to the other folds, and takes the torque to be linear about the model's fit.`);
  get('fixed').textContent = words.join(' ');

  const names = [...new Set(limbs.flatMap((limb) => limb.effects.map(({ effect }) => effect)))];
  const boxes = new Map();
  const placesOf = (name) => limbs.flatMap((limb, n) => limb.effects.flatMap((effect, k) => (effect.effect === name ? [{ ...effect, n, k }] : [])));
  const groups = names.map((name) => ({ name, places: placesOf(name) }));
  const row = ({ name, places }) => {
    const all = make('input', { type: 'checkbox' });
    all.dataset.effect = name;
    const count = make('summary');
    const own = places.map((place) => {
      const box = make('input', { type: 'checkbox' });
      box.dataset.place = `${name}:${place.joint}`;
      box.addEventListener('change', () => { ticked[place.n][place.k] = box.checked; follow([place.n]); });
      return box;
    });
    all.addEventListener('change', () => {
      for (const { n, k } of places) ticked[n][k] = all.checked;
      follow([...new Set(places.map(({ n }) => n))]);
    });
    boxes.set(name, { all, count, own, places });
    const list = make('div', { className: 'joints' }, ...own.map((box, k) => make('label', {}, box, ` ${places[k].joint}`)));
    return make('div', { className: 'row' }, make('label', {}, all, ` ${name}`), make('details', {}, count, list));
  };
  const has = ({ places }) => places.some(({ found }) => found);
  get('ticks').append(...groups.filter(has).map(row));
  const others = groups.filter((group) => !has(group));
  if (others.length) {
    const open = others.length === groups.length;
    get('ticks').append(make('details', { className: 'others', open }, make('summary', { textContent: 'Other effects' }), ...others.map(row)));
  }

  const searched = [...new Set(limbs.flatMap((limb) => limb.searched))];
  if (searched.length) {
    const row = (name) => make('div', { className: 'row' },
      make('label', {}, make('input', { type: 'checkbox', disabled: true }), ` ${name}`),
      make('span', { textContent: `searched: run proprio compare --with ${name}` }));
    get('ticks').append(make('details', { className: 'others' }, make('summary', { textContent: 'Searched effects' }), ...searched.map(row)));
  }

  const body = get('errors').tBodies[0];
  const lines = [...joints.map((joint) => ({ joint, name: joint.name })), { name: 'all' }].map(({ joint, name }) => {
    const cells = ['number', 'number', 'number'].map((className) => make('td', { className }));
    const bars = make('div', { className: 'bars' }, make('i'), make('b'));
    bars.setAttribute('aria-hidden', 'true');
    const head = make('th', { textContent: name, scope: 'row' });
    body.append(make('tr', {}, head, ...cells, make('td', {}, bars)));
    return { joint, cells, bars };
  });
  const select = get('joint');
  select.append(...joints.map(({ name }, k) => make('option', { value: String(k), textContent: name })));
  const worst = joints.reduce((best, joint, k) => (errorOf(before, joint) > errorOf(before, joints[best]) ? k : best), 0);
  select.value = String(worst);
  const plots = [...document.querySelectorAll('#try .plot')];

  function tell() {
    const rms = errorOfAll(now);
    get('rms').textContent = rms.toFixed(4);
    get('rms').dataset.value = String(rms);
    const noise = floor ? `; noise ${Math.min(floor, rms, errorOfAll(found)).toFixed(4)}` : '';
    get('beside').textContent = `held out; ${errorOfAll(before).toFixed(4)} before, ${errorOfAll(found).toFixed(4)} as found${noise}`;
    for (const { joint, cells, bars } of lines) {
      const [was, is] = [before, now].map((fits) => (joint ? errorOf(fits, joint) : errorOfAll(fits)));
      const noise = joint ? joint.floor : floor;
      // An error that is below its noise by chance is at it.
      const rest = noise === null ? null : Math.min(noise, was, is);
      cells.forEach((cell, k) => { const x = [was, is, rest][k]; cell.textContent = Number.isFinite(x) && x !== null ? x.toFixed(4) : '–'; });
      [...bars.children].forEach((bar, k) => { bar.style.width = `${Math.min(100, 100 * [was, is][k] / most)}%`; });
    }
    paintRobot(new Map(joints.map((joint) => [joint.name, errorOf(now, joint)])));
    for (const { all, count, own, places } of boxes.values()) {
      const there = places.map(({ n, k }) => ticked[n][k]);
      own.forEach((box, k) => { box.checked = there[k]; });
      const sum = there.filter(Boolean).length;
      all.checked = sum === there.length;
      all.indeterminate = sum > 0 && sum < there.length;
      count.textContent = `at ${sum} of ${there.length} joints`;
    }
    get('command').textContent = [...first, compare + changes()].join(' && ');
  }

  /** The options by which `proprio compare` judges what is ticked. */
  function changes() {
    const option = (flag, wanted) => {
      const parts = groups.flatMap(({ name, places }) => {
        const changed = places.filter(({ n, k, found: is }) => is === wanted && ticked[n][k] !== is);
        const whole = changed.length === places.filter(({ found: is }) => is === wanted).length;
        if (!changed.length) return [];
        return whole ? [name] : changed.map(({ joint }) => `${name}:${joint}`);
      });
      return parts.length ? ` ${flag} ${parts.join(',')}` : '';
    };
    return option('--without', true) + option('--with', false);
  }

  function drawResiduals() {
    const { name, n, j } = joints[Number(select.value)];
    const left = [before, now].map((fits) => solver.residuals(n, j, fits[n]));
    return Promise.all(plots.map((plot, kind) => {
      const x = solver.windows[n][j].map((row) => row[[1, 0, 2][kind]]);
      const means = left.map((y) => binned(x, y));
      const { data } = specs.get(plot);
      left.forEach((y, k) => Object.assign(data[k], { x, y }));
      means.forEach((mean, k) => Object.assign(data[2 + k], { x: mean.x, y: mean.y }));
      data[3].error_y = { type: 'data', array: means[1].error, thickness: 1.5, width: 0, color: '@model-2' };
      const spans = means.map(({ y }) => (y.length ? `${Math.min(...y).toFixed(3)} to ${Math.max(...y).toFixed(3)} N m` : 'too few windows'));
      const what = ['velocity', 'position', 'torque of the bodies'][kind];
      plot.setAttribute('aria-label', `Residual of ${name} against ${what}; its mean runs from ${spans[0]} before, from ${spans[1]} now`);
      plot.closest('figure').querySelector('figcaption').textContent = `${name}, against ${what}`;
      plot.dataset.shows = name;
      return draw(plot);
    }));
  }

  let shown = Promise.resolve();
  function follow(changed) {
    for (const n of changed) now[n] = solver.fit(n, ticked[n]);
    tell();
    shown = drawResiduals();
  }
  const all = limbs.map((_, n) => n);
  get('as-found').addEventListener('click', () => { ticked = as('found'); follow(all); });
  get('as-before').addEventListener('click', () => { ticked = as('before'); follow(all); });
  select.addEventListener('change', drawResiduals);
  for (const link of document.querySelectorAll('#robot [data-joint]')) {
    const k = joints.findIndex(({ name }) => name === link.dataset.joint);
    if (k >= 0) link.addEventListener('click', () => { select.value = String(k); drawResiduals(); select.scrollIntoView({ block: 'nearest' }); });
  }
  tell();
  await drawResiduals();
}
