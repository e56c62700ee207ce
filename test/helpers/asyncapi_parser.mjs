// What AsyncAPI's own parser says of a document: a line a complaint, then the channels it found.
import { Parser, fromFile } from '@asyncapi/parser';

const { document, diagnostics } = await fromFile(new Parser(), process.argv[2]).parse();
console.log(JSON.stringify({
  complaints: diagnostics.map((one) => `${one.path.join('.')}: ${one.message}`),
  channels: document ? document.channels().all().map((one) => one.id()) : [],
}));
