import {element, format} from './dom.js';

function cell(value) {
  // {verdict: "agrees"} is a coloured word; everything else is text or a number.
  if (value !== null && typeof value === 'object' && 'verdict' in value) {
    return element('td', {}, element('span', {class: `verdict ${value.verdict.replaceAll(' ', '-')}`}, value.verdict));
  }
  return element('td', {class: typeof value === 'number' ? 'number' : undefined}, format(value));
}

export function table(section) {
  const head = element('tr', {}, ...section.columns.map((label) => element('th', {scope: 'col'}, label)));
  const row = (values) => {
    const cells = values.map(cell);
    const first = element('th', {scope: 'row'}, ...cells[0].childNodes);
    return element('tr', {}, first, ...cells.slice(1));
  };
  const kShown = section.show ?? 12;
  const body = element('tbody', {}, ...section.rows.slice(0, kShown).map(row));
  const whole = element('div', {class: 'scroll', tabindex: '0', role: 'region', 'aria-label': `${section.title}: table`},
      element('table', {}, element('thead', {}, head), body));
  if (section.rows.length <= kShown) return whole;
  const more = element('button', {type: 'button', onclick: () => {
    body.append(...section.rows.slice(kShown).map(row));
    more.remove();
  }}, `Show all ${section.rows.length} rows`);
  return element('div', {}, whole, more);
}

export function facts(section) {
  return element('dl', {class: 'facts'}, ...Object.entries(section.rows).flatMap(([key, value]) => [element('dt', {}, key), element('dd', {}, format(value))]));
}

export function text(section) {
  const blocks = section.paragraphs.map((paragraph) => element('p', {}, paragraph));
  if (section.items) blocks.push(element('ul', {}, ...section.items.map((item) => element('li', {}, item))));
  return element('div', {class: 'prose'}, ...blocks);
}
