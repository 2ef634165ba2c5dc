(function () {
  'use strict';
  const colours = JSON.parse(document.getElementById('colours').textContent);
  const system = window.matchMedia('(prefers-color-scheme: dark)');
  const button = document.getElementById('theme');
  const sources = new Map();
  let chosen = null;

  // Text of an element that holds it as gzip in base64.
  function unpacked(element) {
    const bytes = Uint8Array.from(atob(element.textContent), (char) => char.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
    return new Response(stream).text();
  }

  async function load() {
    const places = document.querySelectorAll('.drawing');
    if (!places.length) { return; }
    const plotly = document.createElement('script');
    plotly.textContent = await unpacked(document.getElementById('plotly'));
    document.head.append(plotly);
    for (const place of places) { sources.set(place, await unpacked(place.nextElementSibling)); }
  }

  function dark() { return chosen === null ? system.matches : chosen === 'dark'; }

  // Fills carry two more digits behind the colour, so only the first seven characters change.
  function drawing(source) {
    if (!dark()) { return JSON.parse(source); }
    return JSON.parse(source.replace(/#[0-9A-Fa-f]{6}/g, (found) => colours[found.toUpperCase()] || found));
  }

  function draw() {
    const narrow = window.innerWidth < 640;
    sources.forEach((source, place) => {
      const figure = drawing(source);
      if (narrow) { figure.layout.margin = { l: 48, r: 8, t: figure.layout.margin.t, b: 48 }; }
      Plotly.react(place, figure.data, figure.layout, {
        responsive: true, displaylogo: false, displayModeBar: narrow ? false : undefined,
        modeBarButtons: [['zoom2d', 'pan2d', 'resetScale2d', 'toImage']],
      });
    });
    button.textContent = dark() ? 'light' : 'dark';
  }

  button.hidden = false;
  button.addEventListener('click', () => {
    chosen = dark() ? 'light' : 'dark';
    document.documentElement.dataset.theme = chosen;
    draw();
  });
  system.addEventListener('change', draw);
  // Paper is 210 mm wide, less its margins; figures do not follow by themselves.
  window.addEventListener('beforeprint', () => {
    sources.forEach((_, place) => Plotly.relayout(place, { width: 680 }));
  });
  window.addEventListener('afterprint', draw);
  if (location.hash === '#dark' || location.hash === '#light') {
    chosen = location.hash.slice(1);
    document.documentElement.dataset.theme = chosen;
  }
  load().then(() => {
    draw();
    document.documentElement.dataset.drawn = 'yes';
  });
}());
