// Bundles the page's script and style and writes them as a C++ source: node build.mjs OUTPUT.cpp
import {readFile, writeFile} from 'node:fs/promises';
import {build} from 'esbuild';

const output = process.argv[2];
const bundle = await build({
  entryPoints: ['src/main.js'],
  bundle: true,
  minify: true,
  format: 'iife',
  target: ['chrome110', 'firefox115', 'safari16.4'],
  write: false,
  legalComments: 'inline',
  loader: {'.css': 'text'},
});
const script = bundle.outputFiles[0].text.replaceAll('</script', '<\\/script');
const template = await readFile('src/page.html', 'utf8');
const page = template.replace('/*SCRIPT*/', () => script);

// C++ string literals of at most 4000 characters, joined by the compiler.
const literals = [];
for (let i = 0; i < page.length; i += 4000) literals.push(JSON.stringify(page.slice(i, i + 4000)).replace(/[^\x00-\x7f]/g, escapeUtf8).replaceAll('??', '?\\?'));
function escapeUtf8(character) {
  return [...new TextEncoder().encode(character)].map((byte) => '\\' + byte.toString(8).padStart(3, '0')).join('');
}
await writeFile(output, `// Generated from report/page by build.mjs.
namespace interglow::report::detail {
extern const char* const kPageTemplate;
const char* const kPageTemplate =
${literals.join('\n')};
}  // namespace interglow::report::detail
`);
