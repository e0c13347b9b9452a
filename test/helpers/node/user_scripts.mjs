// Copyright 2026 The masmc_ros authors
// SPDX-License-Identifier: Apache-2.0

// Compiles a layout's user scripts strictly, as Lichtblick does: against types generated from the
// message definitions of the log. The scripts can only import the module "./types".
import typescript from "typescript";

const FOLDER = "/studio_script";
const TYPES = `
import { MessageTypeByTopic } from "./generatedTypes";
export type Time = { sec: number; nsec: number };
export type Input<T extends keyof MessageTypeByTopic> = {
  topic: T;
  receiveTime: Time;
  message: MessageTypeByTopic[T];
};
`;
const ARRAYS = {
  int8: "Int8Array", uint8: "Uint8Array", int16: "Int16Array", uint16: "Uint16Array",
  int32: "Int32Array", uint32: "Uint32Array", int64: "BigInt64Array", uint64: "BigUint64Array",
  float32: "Float32Array", float64: "Float64Array",
};
const VALUES = {
  bool: "boolean", string: "string", int64: "bigint", uint64: "bigint",
  time: "{ sec: number; nsec: number }", duration: "{ sec: number; nsec: number }",
};
const OPTIONS = {
  strict: true,
  target: typescript.ScriptTarget.ES2022,
  module: typescript.ModuleKind.CommonJS,
  lib: ["lib.es2022.d.ts"],
  types: [],
};

// Returns the type of a message as TypeScript, with all nested types expanded.
function literal(definition, definitions) {
  const fields = definition.definitions.filter((field) => !field.isConstant).map((field) => {
    const named = definitions.find((other) => other.name === field.type);
    const one = field.isComplex ? literal(named, definitions) : VALUES[field.type] ?? "number";
    const type = field.isArray ? ARRAYS[field.type] ?? `(${one})[]` : one;
    return `${JSON.stringify(field.name)}: ${type}`;
  });
  return `{ ${fields.join("; ")} }`;
}

function typesOf(topics) {
  const fields = topics.map(({ topic, definitions }) => {
    const root = definitions.find((other) => other.name == undefined) ?? definitions[0];
    return `${JSON.stringify(topic)}: ${literal(root, definitions)}`;
  });
  return `export type MessageTypeByTopic = {\n${fields.join(";\n")}\n};\n`;
}

// The viewer derives a schema from a script's output: objects, numbers, strings, booleans and
// arrays of these that are written as `type[]`.
function faultOfOutput(checker, node) {
  const { SyntaxKind } = typescript;
  switch (node.kind) {
    case SyntaxKind.NumberKeyword:
    case SyntaxKind.StringKeyword:
    case SyntaxKind.BooleanKeyword:
      return undefined;
    case SyntaxKind.ArrayType:
      return faultOfOutput(checker, node.elementType);
    case SyntaxKind.TypeReference: {
      const [declaration] = checker.getSymbolAtLocation(node.typeName).declarations;
      return typescript.isTypeAliasDeclaration(declaration)
        ? faultOfOutput(checker, declaration.type)
        : `the type ${node.getText()} cannot be returned`;
    }
    case SyntaxKind.TypeLiteral:
      return node.members.map((member) => faultOfOutput(checker, member.type)).find(Boolean);
    default:
      return `the type ${node.getText()} cannot be returned`;
  }
}

// A script may return `Output | undefined`: undefined is no message.
function withoutNothing(type) {
  if (!typescript.isUnionTypeNode(type)) return type;
  const others = type.types.filter(({ kind }) => kind !== typescript.SyntaxKind.UndefinedKeyword);
  return others.length === 1 ? others[0] : type;
}

// Returns the JavaScript (CommonJS) of a script, or throws the viewer's error.
export function compiled(sourceCode, topics) {
  const index = `${FOLDER}/index.ts`;
  const files = new Map([
    [index, sourceCode],
    [`${FOLDER}/types.ts`, TYPES],
    [`${FOLDER}/generatedTypes.ts`, typesOf(topics)],
  ]);
  const host = typescript.createCompilerHost(OPTIONS);
  const { getSourceFile, fileExists, readFile } = host;
  let text = "";
  Object.assign(host, {
    getCurrentDirectory: () => "/",
    directoryExists: undefined,
    fileExists: (name) => files.has(name) || (!name.startsWith(FOLDER) && fileExists(name)),
    readFile: (name) => files.get(name) ?? readFile(name),
    getSourceFile: (name, ...rest) =>
      files.has(name)
        ? typescript.createSourceFile(name, files.get(name), OPTIONS.target, true)
        : getSourceFile.call(host, name, ...rest),
    writeFile: (name, data) => {
      if (name === `${FOLDER}/index.js`) text = data;
    },
  });
  const program = typescript.createProgram([index], OPTIONS, host);
  program.emit();
  const faults = [...program.getSemanticDiagnostics(), ...program.getSyntacticDiagnostics()].map(
    (problem) => typescript.flattenDiagnosticMessageText(problem.messageText, "\n"),
  );
  const checker = program.getTypeChecker();
  const source = program.getSourceFile(index);
  const script = source.statements.find(
    (node) => typescript.isFunctionDeclaration(node) &&
      node.modifiers?.some(({ kind }) => kind === typescript.SyntaxKind.DefaultKeyword),
  );
  const fault = script?.type
    ? faultOfOutput(checker, withoutNothing(script.type))
    : "expected a default export: a function with the type that it returns";
  if (faults.length > 0 || fault) throw new Error([...faults, fault].filter(Boolean).join("\n"));
  return text;
}

// Returns the scripts of a layout: inputs, output, function, and a list for their messages.
export function scriptsOf(layout, topics) {
  return Object.entries(layout.userNodes).map(([name, { sourceCode }]) => {
    const exports = {};
    try {
      new Function("exports", compiled(sourceCode, topics))(exports);
    } catch (error) {
      throw new Error(`user script ${name}: ${error.message}`);
    }
    const unknown = exports.inputs.filter((input) => !topics.some(({ topic }) => topic === input));
    if (unknown.length > 0) throw new Error(`user script ${name}: ${unknown} is not in the log`);
    return { ...exports, made: [] };
  });
}
