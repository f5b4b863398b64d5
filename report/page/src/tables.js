import {element, format} from './dom.js';

// The roles stay where a narrow window shows rows as blocks, each value beside the label of its column.
function cell(value, label) {
  const shared = {role: 'cell', 'data-label': label};
  // {verdict: "agrees"} is a coloured word; everything else is text or a number.
  if (value !== null && typeof value === 'object' && 'verdict' in value) {
    return element('td', shared, element('span', {class: `verdict ${value.verdict.replaceAll(' ', '-')}`}, value.verdict));
  }
  return element('td', {...shared, class: typeof value === 'number' ? 'number' : undefined}, format(value));
}

export function table(section) {
  const head = element('tr', {role: 'row'}, ...section.columns.map((label) => element('th', {scope: 'col', role: 'columnheader'}, label)));
  const row = (values) => {
    const cells = values.map((value, k) => cell(value, section.columns[k]));
    const first = element('th', {scope: 'row', role: 'rowheader'}, ...cells[0].childNodes);
    return element('tr', {role: 'row'}, first, ...cells.slice(1));
  };
  const kShown = section.show ?? 12;
  const body = element('tbody', {role: 'rowgroup'}, ...section.rows.slice(0, kShown).map(row));
  const whole = element('div', {class: 'scroll', tabindex: '0', role: 'region', 'aria-label': `${section.title}: table`},
      element('table', {role: 'table'}, element('thead', {role: 'rowgroup'}, head), body));
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
