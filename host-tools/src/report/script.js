'use strict';
(() => {
  const root = document.documentElement;
  const plots = [...document.querySelectorAll('.plot')];
  /** What each plot draws, with colours by meaning. */
  const specs = new Map(plots.map((plot) => [plot, JSON.parse(plot.nextElementSibling.textContent)]));
  /** The x range that the plots of a group show; absent: all. */
  const ranges = new Map();
  for (const [plot, { layout }] of specs) {
    if (plot.dataset.group && layout.xaxis.range) {
      ranges.set(plot.dataset.group, layout.xaxis.range);
      delete layout.xaxis.range;
    }
  }
  /** What a link to a moment shows before and after it, s. */
  const AROUND = 1;
  const finger = matchMedia('(pointer: coarse)').matches;
  const hover = matchMedia('(hover: hover)').matches;
  const systemDark = matchMedia('(prefers-color-scheme: dark)');
  const probe = document.body.appendChild(document.createElement('span'));
  probe.hidden = true;

  const font = getComputedStyle(document.body).fontFamily;
  const printing = () => root.classList.contains('printing');

  /** The theme's colours by the style sheet's names; each is looked up once. */
  function palette() {
    const known = new Map();
    return (name) => {
      if (!known.has(name)) {
        probe.style.color = `var(--${name})`;
        known.set(name, getComputedStyle(probe).color);
      }
      return known.get(name);
    };
  }

  /** A copy of `value` with the theme's colours in the places of their meanings. */
  function painted(value, key, colour) {
    if (Array.isArray(value)) return value[0]?.constructor === Object ? value.map((v) => painted(v, key, colour)) : value;
    if (value?.constructor === Object) {
      return Object.fromEntries(Object.entries(value).map(([k, v]) => [k, painted(v, k, colour)]));
    }
    return typeof value === 'string' && value[0] === '@' && /color$/.test(key) ? colour(value.slice(1)) : value;
  }

  /** What Plotly is told to draw: the plot's own, in this theme, at this size, at this zoom. */
  function themed(plot, colour) {
    const { data, layout } = painted(specs.get(plot), '', colour);
    const hidden = hiddenTraces(plot);
    data.forEach((trace, n) => { trace.visible = !hidden.has(n); });
    for (const axis of Object.entries(layout).filter(([name]) => /^[xy]axis/.test(name)).map(([, axis]) => axis)) {
      Object.assign(axis, { gridcolor: colour('grid'), zerolinecolor: colour('rule'), linecolor: colour('rule') });
      axis.title = { ...axis.title, standoff: 8 };
    }
    // Where nothing hovers the buttons stay, above the plot.
    if (!hover && !printing()) layout.margin.t = 32;
    const range = ranges.get(plot.dataset.group);
    if (range) Object.assign(layout.xaxis, { range: [...range], autorange: false });
    Object.assign(layout, {
      width: plot.clientWidth,
      height: plot.clientHeight,
      paper_bgcolor: 'rgba(0,0,0,0)',
      plot_bgcolor: 'rgba(0,0,0,0)',
      font: { family: font, size: 12, color: colour('quiet') },
      hoverlabel: { bgcolor: colour('raised'), bordercolor: colour('rule'), font: { color: colour('text') } },
      modebar: { bgcolor: 'rgba(0,0,0,0)', color: colour('quiet'), activecolor: colour('text') },
      hovermode: plot.dataset.group ? 'x unified' : 'closest',
      hoversubplots: 'axis',
      // As long as it shows the same, a plot that is drawn anew keeps the reader's zoom.
      uirevision: plot.dataset.shows ?? 'same',
      // A finger scrolls the page; the buttons zoom.
      dragmode: finger ? false : 'zoom',
    });
    return { data, layout };
  }

  function hiddenTraces(plot) {
    const off = plot.closest('section').querySelectorAll('.legend [aria-pressed="false"]');
    return new Set([...off].map((button) => Number(button.dataset.trace)));
  }

  /** Draws what can be seen; the rest when it is unfolded. */
  function draw(plot, colour = palette()) {
    plot.classList.toggle('stale', !isOpen(plot));
    if (!isOpen(plot)) return Promise.resolve();
    const { data, layout } = themed(plot, colour);
    const first = !plot.classList.contains('js-plotly-plot');
    const done = Plotly.react(plot, data, layout, {
      displaylogo: false,
      doubleClick: 'autosize',
      displayModeBar: !printing() && (hover ? 'hover' : true),
      modeBarButtonsToRemove: ['select2d', 'lasso2d', 'resetScale2d'],
      toImageButtonOptions: { format: 'svg' },
    });
    if (first && plot.dataset.group) {
      plot.on('plotly_relayout', (change) => follow(plot, change));
      plot.on('plotly_hover', ({ xvals, points }) => moveCursor(plot.dataset.group, xvals?.[0] ?? points[0].x));
      plot.on('plotly_unhover', () => moveCursor(plot.dataset.group));
    }
    return done;
  }

  function drawAll() {
    const colour = palette();
    return Promise.all(plots.filter((plot) => plot.classList.contains('js-plotly-plot')).map((plot) => draw(plot, colour)));
  }

  /** One cursor at the same place in all drawn plots of a group; without a place there is none. */
  function moveCursor(group, x) {
    for (const plot of plots.filter((plot) => plot.dataset.group === group && plot._fullLayout && isOpen(plot))) {
      const { xaxis, _size: { t, h } } = plot._fullLayout;
      const along = xaxis.d2p(x);
      const cursor = plot.parentElement.querySelector('.cursor') ?? plot.parentElement.appendChild(make('i', { className: 'cursor' }));
      cursor.hidden = !(along >= 0 && along <= xaxis._length);
      Object.assign(cursor.style, {
        left: `${plot.offsetLeft + xaxis._offset + along}px`, top: `${plot.offsetTop + t}px`, height: `${h}px`,
      });
    }
  }

  const allOf = (plot) => Object.fromEntries(Object.keys(plot._fullLayout).filter((key) => /^[xy]axis\d*$/.test(key)).map((key) => [`${key}.autorange`, true]));

  /** Moves the others of the plot's group to where it went. */
  let following = false;
  async function follow(plot, change) {
    if (following) return;
    const whole = change['xaxis.autorange'];
    const range = change['xaxis.range'] ?? [change['xaxis.range[0]'], change['xaxis.range[1]']];
    if (!whole && !(Number.isFinite(range[0]) && Number.isFinite(range[1]))) return;
    const { group } = plot.dataset;
    if (whole) ranges.delete(group); else ranges.set(group, range);
    following = true;
    const others = plots.filter((other) => other !== plot && other.dataset.group === group && other._fullLayout);
    await Promise.all(others.map((other) => Plotly.relayout(other, whole ? allOf(other) : { 'xaxis.range': [...range] })));
    following = false;
  }

  /** Unpacks the plotting library and runs it. */
  async function loadLibrary() {
    const script = document.createElement('script');
    script.textContent = new TextDecoder().decode(await unpack('library'));
    document.head.append(script);
  }

  /** Whether a plot is not within something folded. */
  function isOpen(plot) {
    for (let fold = plot.closest('details'); fold; fold = fold.parentElement.closest('details')) if (!fold.open) return false;
    return true;
  }

  /** What is folded is drawn when it is opened; a link to it opens it, and so does paper. */
  function wireFolds() {
    for (const fold of document.querySelectorAll('section > details')) {
      fold.addEventListener('toggle', async () => {
        if (!fold.open || !window.Plotly) return;
        for (const plot of fold.querySelectorAll('.plot:not(.js-plotly-plot), .plot.stale')) await draw(plot);
      });
    }
    // A desk has room for the first section.
    const first = document.querySelector('section > details');
    if (first && matchMedia('(min-width: 75rem)').matches) first.open = true;
    const open = () => {
      const fold = location.hash.length > 1 && document.querySelector(`#${CSS.escape(location.hash.slice(1))} > details`);
      if (fold) fold.open = true;
    };
    addEventListener('hashchange', open);
    open();
  }

  /** A finding's link opens its joint's plot at its time. */
  function wireMoments() {
    for (const link of document.querySelectorAll('.moment')) {
      link.addEventListener('click', async (event) => {
        const section = document.getElementById('torque');
        const titles = [...section?.querySelectorAll('figcaption') ?? []];
        const plot = titles.find((title) => title.textContent === link.dataset.joint)?.parentElement.querySelector('.plot');
        if (!plot || !window.Plotly) return;
        event.preventDefault();
        const time = Number(link.dataset.time);
        ranges.set('time', [time - AROUND, time + AROUND]);
        const fold = plot.closest('details');
        if (fold) fold.open = true;
        for (const other of plots.filter(({ dataset }) => dataset.group === 'time')) await draw(other);
        plot.parentElement.scrollIntoView({ block: 'center' });
        moveCursor('time', time);
      });
    }
  }

  function wireCopies() {
    for (const button of document.querySelectorAll('[data-copy]')) {
      button.addEventListener('click', async () => {
        const code = document.getElementById(button.dataset.copy);
        getSelection().selectAllChildren(code);
        try {
          await navigator.clipboard.writeText(code.textContent);
          button.textContent = 'Copied';
        } catch {
          button.textContent = 'Selected';
        }
      });
    }
  }

  async function start() {
    if (plots.length) {
      await loadLibrary();
      for (const plot of plots.filter(isOpen)) {
        await draw(plot);
        // The page answers between two plots.
        await new Promise((next) => setTimeout(next));
      }
      await startChoices(specs, draw);
    }
    root.dataset.ready = 'yes';
  }

  function wireTheme() {
    const button = document.getElementById('theme');
    const dark = () => (root.dataset.theme ?? (systemDark.matches ? 'dark' : 'light')) === 'dark';
    const label = () => { button.textContent = dark() ? 'Light' : 'Dark'; };
    button.hidden = false;
    button.addEventListener('click', () => {
      root.dataset.theme = dark() ? 'light' : 'dark';
      label();
      drawAll();
    });
    systemDark.addEventListener('change', () => { label(); drawAll(); });
    label();
  }

  function wirePaper() {
    let folded = [];
    const paper = (on) => () => {
      root.classList.toggle('printing', on);
      if (on) folded = [...document.querySelectorAll('section > details:not([open])')];
      for (const fold of folded) fold.open = on;
      const colour = palette();
      for (const plot of window.Plotly ? plots : []) draw(plot, colour);
    };
    addEventListener('beforeprint', paper(true));
    addEventListener('afterprint', paper(false));
    let soon;
    const fit = () => {
      const misfit = (plot) => plot._fullLayout && plot._fullLayout.width !== plot.clientWidth;
      for (const plot of plots.filter(misfit)) draw(plot);
    };
    new ResizeObserver(() => {
      clearTimeout(soon);
      soon = setTimeout(fit, 150);
    }).observe(document.querySelector('main'));
  }

  function wireLegends() {
    for (const button of document.querySelectorAll('.legend [data-trace]')) {
      button.addEventListener('click', () => {
        button.setAttribute('aria-pressed', String(button.getAttribute('aria-pressed') !== 'true'));
        for (const plot of button.closest('section').querySelectorAll('.js-plotly-plot')) draw(plot);
      });
    }
    for (const button of document.querySelectorAll('.whole')) {
      button.addEventListener('click', () => {
        for (const plot of button.closest('section').querySelectorAll('.js-plotly-plot')) {
          ranges.delete(plot.dataset.group);
          Plotly.relayout(plot, allOf(plot));
        }
      });
    }
  }

  function wireTable(box) {
    const body = box.querySelector('tbody');
    const rows = [...body.rows];
    const heads = [...box.querySelectorAll('th')];
    const key = (row, n) => {
      const { value } = row.cells[n].dataset;
      return value === undefined ? row.cells[n].textContent : value === '' ? Infinity : Number(value);
    };
    heads.forEach((head, n) => head.querySelector('button').addEventListener('click', () => {
      const down = head.getAttribute('aria-sort') === 'ascending';
      for (const other of heads) other.removeAttribute('aria-sort');
      head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
      const sign = down ? -1 : 1;
      rows.sort((a, b) => {
        const [x, y] = [key(a, n), key(b, n)];
        return sign * (typeof x === 'number' ? (x === y ? 0 : x - y) : x.localeCompare(y));
      });
      body.append(...rows);
    }));
    const filter = box.querySelector('.filter input');
    filter?.addEventListener('input', () => {
      const words = filter.value.toLowerCase().split(/\s+/);
      for (const row of rows) {
        const text = row.textContent.toLowerCase();
        row.hidden = !words.every((word) => text.includes(word));
      }
      const shown = rows.filter((row) => !row.hidden).length;
      box.querySelector('output').textContent = `${shown} of ${rows.length}`;
    });
  }

  wireTheme();
  wirePaper();
  wireLegends();
  wireFolds();
  wireCopies();
  wireMoments();
  paintRobotAsWritten();
  document.querySelectorAll('.table').forEach(wireTable);
  start().catch((error) => {
    const note = document.createElement('p');
    note.className = 'failed';
    note.textContent = `The plots cannot be drawn; a browser of 2024 or later is needed. (${error})`;
    document.querySelector('main').prepend(note);
    root.dataset.ready = 'failed';
    console.error(error);
  });
})();
