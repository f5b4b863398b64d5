import uPlot from 'uplot';
import {element, format} from './dom.js';

// Okabe and Ito (2008): told apart by all kinds of colour vision.
export const kColours = ['#0072b2', '#d55e00', '#009e73', '#cc79a7', '#56b4e9', '#e69f00', '#000000'];
const kDashes = [[], [6, 4], [2, 3], [8, 3, 2, 3]];

// Series with their own x are joined on one axis, as uPlot wants them.
function joined(series) {
  const tables = series.map((one) => {
    const order = one.x.map((_, i) => i).sort((a, b) => one.x[a] - one.x[b]);
    return [order.map((i) => one.x[i]), order.map((i) => one.y[i])];
  });
  return uPlot.join(tables);
}

function intervals(series) {
  return {
    hooks: {
      draw: [(plot) => {
        const {ctx} = plot;
        series.forEach((one, k) => {
          if (!one.low) return;
          ctx.save();
          ctx.strokeStyle = one.colour ?? kColours[k % kColours.length];
          ctx.lineWidth = devicePixelRatio;
          ctx.globalAlpha = 0.6;
          one.x.forEach((x, i) => {
            const left = plot.valToPos(x, 'x', true);
            ctx.beginPath();
            ctx.moveTo(left, plot.valToPos(one.low[i], 'y', true));
            ctx.lineTo(left, plot.valToPos(one.high[i], 'y', true));
            ctx.stroke();
          });
          ctx.restore();
        });
      }],
    },
  };
}

const kBars = uPlot.paths.bars({size: [0.95, 64]});

export function drawChart(host, section, height = 300) {
  host.replaceChildren();
  const width = Math.max(240, host.clientWidth);
  const axis = (description) => ({
    label: description.label,
    labelSize: 18,
    font: '12px system-ui, sans-serif',
    labelFont: '12px system-ui, sans-serif',
    size: 56,
    grid: {stroke: '#ddd'},
    stroke: '#333',
    values: (_, ticks) => ticks.map((tick) => (tick === null ? '' : format(tick))),
  });
  const scale = (description) => ({
    time: false,
    distr: description.scale === 'log' ? 3 : 1,
    range: description.range ? () => description.range : description.fromZero ? (_, low, high) => [0, 1.05 * high] : undefined,
  });
  return new uPlot({
    width,
    height,
    legend: {live: false},
    cursor: {drag: {x: true, y: true}, focus: {prox: 16}},
    scales: {x: scale(section.x), y: scale({...section.y, fromZero: section.series.some((one) => one.bars)})},
    axes: [{...axis(section.x), size: 40}, axis(section.y)],
    plugins: [intervals(section.series)],
    series: [{label: section.x.label}, ...section.series.map((one, k) => ({
      label: one.name,
      stroke: one.colour ?? kColours[k % kColours.length],
      fill: one.bars ? (one.colour ?? kColours[k % kColours.length]) + '55' : undefined,
      dash: kDashes[Math.floor(k / kColours.length) % kDashes.length],
      width: one.line === false ? 0 : 1.5,
      paths: one.bars ? kBars : one.line === false ? () => null : undefined,
      points: {show: one.points ?? false, size: 6, fill: one.colour ?? kColours[k % kColours.length]},
      spanGaps: true,
    }))],
  }, joined(section.series), host);
}

// The same numbers for those who do not see the drawing.
function numbers(section) {
  const rows = section.series.flatMap((one) => one.x.map((x, i) => [one.name, x, one.y[i]]));
  const kMost = 400;
  const body = rows.slice(0, kMost).map((row) => element('tr', {}, element('th', {scope: 'row'}, row[0]),
      element('td', {class: 'number'}, format(row[1])), element('td', {class: 'number'}, format(row[2]))));
  const head = element('tr', {}, ...['Series', section.x.label, section.y.label].map((label) => element('th', {scope: 'col'}, label)));
  const note = rows.length > kMost ? element('p', {}, `The first ${kMost} of ${rows.length}; all are in the data of this page.`) : null;
  return element('details', {}, element('summary', {}, 'Numbers'),
      element('div', {class: 'scroll', tabindex: '0', role: 'region', 'aria-label': `Numbers of ${section.title}`},
          element('table', {}, element('thead', {}, head), element('tbody', {}, ...body))), note);
}

export function chart(section) {
  const host = element('div', {class: 'chart', role: 'img', 'aria-label': `${section.title}: ${section.y.label} over ${section.x.label}`});
  const draw = () => drawChart(host, section);
  new ResizeObserver(draw).observe(host);
  return element('div', {}, host, numbers(section));
}
