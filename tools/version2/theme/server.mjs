/** A minimal theme for version 2 of Jupyter Book: one plain HTML page for each source. */
import { createServer } from 'node:http';
import { toHtml } from 'hast-util-to-html';
import { toHast } from 'mdast-util-to-hast';

const { CONTENT_CDN_PORT, HOST, PORT } = process.env;
const content = `http://localhost:${CONTENT_CDN_PORT}/content`;

const element = (tagName, properties = () => ({})) => (state, node) => ({
  type: 'element', tagName, properties: properties(node), children: state.all(node),
});
const rendered = (_, node) => ({ type: 'raw', value: node.html });
const handlers = {
  admonition: element('aside'),
  admonitionTitle: element('strong'),
  crossReference: element('a', (node) => ({ href: `#${node.html_id}` })),
  inlineMath: rendered,
  math: rendered,
  span: element('span', (node) => ({ className: node.class })),
};

async function data(name) {
  for (const file of [name, `${name}.index`]) {
    const response = await fetch(`${content}/${file.replaceAll('/', '.')}.json`);
    if (response.ok) return response.json();
  }
  throw new Error(`no page ${name}`);
}

async function page(name) {
  const { frontmatter, mdast } = await data(name);
  const body = toHtml(toHast(mdast, { handlers }), { allowDangerousHtml: true });
  const title = toHtml({ type: 'text', value: frontmatter.title });
  return `<!doctype html><html lang="en"><meta charset="utf-8"><title>${title}</title>
<link rel="stylesheet" href="/plain.css"><h1>${title}</h1>${body}</html>`;
}

async function answer(path) {
  const [name, suffix] = path.slice(1).replace(/\/$/, '').split('.');
  if (suffix === undefined) return page(name || 'index');
  return suffix === 'json' ? JSON.stringify(await data(name)) : '';
}

createServer(({ url }, response) => {
  answer(new URL(url, content).pathname)
    .then((text) => response.end(text))
    .catch((error) => response.writeHead(404).end(String(error)));
}).listen(PORT, HOST, () => console.log(`Server started on http://${HOST}:${PORT}`));
