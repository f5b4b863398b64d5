import {element, format, svg} from './dom.js';

// Intervals of relative differences against the margin: {margin, rows: [{name, value, low, high, verdict}]}, in percent.
export function forest(section) {
  const kRow = 22;
  // As wide as the window allows, so that the words keep their size on a telephone.
  const kWidth = Math.max(340, Math.min(760, document.documentElement.clientWidth - 32));
  const kLabel = kWidth < 560 ? 160 : 190;
  const kRight = kWidth < 560 ? 66 : 90;
  const rows = section.rows;
  const reach = Math.max(section.margin * 1.6, ...rows.map((row) => Math.min(Math.max(Math.abs(row.low), Math.abs(row.high)), section.margin * 6)));
  const x = (value) => kLabel + ((Math.max(-reach, Math.min(reach, value)) + reach) / (2 * reach)) * (kWidth - kLabel - kRight);
  const height = rows.length * kRow + 44;
  const plot = svg('svg', {viewBox: `0 0 ${kWidth} ${height}`, class: 'forest', role: 'img',
    'aria-label': `${section.title}: intervals against a margin of ${format(section.margin)} ${section.unit}`});
  plot.append(svg('rect', {x: x(-section.margin), y: 4, width: x(section.margin) - x(-section.margin), height: rows.length * kRow + 4, class: 'margin'}));
  plot.append(svg('line', {x1: x(0), x2: x(0), y1: 4, y2: rows.length * kRow + 8, class: 'zero'}));
  rows.forEach((row, i) => {
    const y = i * kRow + 18;
    const label = svg('text', {x: kLabel - 8, y: y + 4, class: 'label', 'text-anchor': 'end'});
    label.textContent = row.name;
    const value = svg('text', {x: kWidth - kRight + 8, y: y + 4, class: 'label'});
    value.textContent = `${row.value.toFixed(3)} ${section.unit}`;
    plot.append(label, value,
        svg('line', {x1: x(row.low), x2: x(row.high), y1: y, y2: y, class: `interval ${row.verdict}`}),
        svg('rect', {x: x(row.value) - 3.5, y: y - 3.5, width: 7, height: 7, class: `interval ${row.verdict}`}));
  });
  const foot = rows.length * kRow + 26;
  for (const value of [-section.margin, 0, section.margin]) {
    const tick = svg('text', {x: x(value), y: foot, class: 'label', 'text-anchor': 'middle'});
    tick.textContent = `${format(value)} ${section.unit}`;
    plot.append(tick);
  }
  return element('div', {class: 'scroll', tabindex: '0', role: 'region', 'aria-label': `${section.title}: intervals`}, plot);
}
