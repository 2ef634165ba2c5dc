(function () {
  'use strict';
  const colours = JSON.parse(document.getElementById('colours').textContent);
  const system = window.matchMedia('(prefers-color-scheme: dark)');
  const button = document.getElementById('theme');
  let chosen = null;

  function dark() { return chosen === null ? system.matches : chosen === 'dark'; }

  // Fills carry two more digits behind the colour, so only the first seven characters change.
  function drawing(source) {
    if (!dark()) { return JSON.parse(source); }
    return JSON.parse(source.replace(/#[0-9A-Fa-f]{6}/g, (found) => colours[found.toUpperCase()] || found));
  }

  function draw() {
    const narrow = window.innerWidth < 640;
    document.querySelectorAll('.drawing').forEach((place) => {
      const figure = drawing(place.nextElementSibling.textContent);
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
  if (location.hash === '#dark' || location.hash === '#light') {
    chosen = location.hash.slice(1);
    document.documentElement.dataset.theme = chosen;
  }
  draw();
  document.documentElement.dataset.drawn = 'yes';
}());
