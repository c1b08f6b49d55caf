/** Roles of the book for version 2 of Jupyter Book: computed numbers, and names of Python. */
import { readFileSync } from 'node:fs';

const facts = JSON.parse(readFileSync('_build/facts.json', 'utf-8'));

const number = (name, key) => ({
  name,
  body: { type: String, required: true },
  run({ body }, file) {
    const value = facts[key(body)];
    if (value === undefined) file.fail(`no fact is called '${key(body)}'`);
    return [{ type: 'span', class: 'rp-fact', children: [{ type: 'text', value }] }];
  },
});

const python = (name) => ({
  name: `py:${name}`,
  body: { type: String, required: true },
  run: ({ body }) => [{ type: 'inlineCode', value: body.replace(/^~.*\./, '') }],
});

export default {
  name: 'Numbers of the book',
  roles: [
    number('fact', (text) => text),
    ...['printed', 'computed', 'verdict'].map((role) => number(role, (text) => `${text} ${role}`)),
    ...['func', 'meth', 'class', 'mod'].map(python),
  ],
};
