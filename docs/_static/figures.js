// Figures and pictures follow the theme of the page (light or dark).
(function () {
  'use strict';
  const page = document.documentElement;

  function dark() { return page.dataset.theme === 'dark'; }

  // Fills carry two more digits behind the colour, so only the first seven characters change.
  function figure(source) {
    if (!dark()) { return JSON.parse(source); }
    return JSON.parse(source.replace(/#[0-9A-Fa-f]{6}/g,
      (found) => COLOURS[found.toUpperCase()] || found));
  }

  function show() {
    const narrow = window.innerWidth < 640;
    document.querySelectorAll('.drawing').forEach((place) => {
      const drawing = figure(place.nextElementSibling.textContent);
      if (narrow) {
        const top = (drawing.layout.margin || { t: 44 }).t;
        drawing.layout.margin = { l: 48, r: 8, t: top, b: 48 };
      }
      Plotly.react(place, drawing.data, drawing.layout, {
        responsive: true, displaylogo: false, displayModeBar: false,
      });
    });
    document.querySelectorAll('picture source').forEach((source) => {
      source.media = dark() ? 'all' : 'not all';
    });
  }

  new MutationObserver(show).observe(page, { attributeFilter: ['data-theme'] });
  show();
}());
