// Sentences with places to fill in.

/** A generated sentence, with a value in place of each {} in turn. */
export function fill(template: string, ...values: readonly (string | number)[]): string {
  let next = 0;
  const text = template.replaceAll("{}", () => String(values[next++] ?? "{}"));
  if (next !== values.length || text.includes("{}")) {
    throw new RangeError(`${values.length} values for: ${template}`);
  }
  return text;
}
