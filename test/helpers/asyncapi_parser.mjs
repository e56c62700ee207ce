// Copyright 2026 The box_contact_ros maintainers
// SPDX-License-Identifier: Apache-2.0

// What AsyncAPI's own parser says of a document: a line a complaint, then the channels it found.
import { Parser, fromFile } from '@asyncapi/parser';

const { document, diagnostics } = await fromFile(new Parser(), process.argv[2]).parse();
console.log(JSON.stringify({
  complaints: diagnostics.map((one) => `${one.path.join('.')}: ${one.message}`),
  channels: document ? document.channels().all().map((one) => one.id()) : [],
}));
