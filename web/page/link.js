// The part of the address after #: the tab, and all settings of a run that differ from the defaults.

/** The settings in the address, as text by name. */
export function read() {
  return Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
}

/** Puts settings into the address, without a new entry in the history; those that are as `usual` are left out. */
export function write(settings, usual) {
  const told = Object.entries(settings).filter(([name, value]) => value !== null && String(value) !== String(usual[name] ?? ""));
  history.replaceState(null, "", `#${new URLSearchParams(told)}`);
}

/** A number in the address, or the usual one where it is none. */
export function number(text, usual, [least, largest]) {
  const value = text === undefined || text === "" ? NaN : Number(text);
  return Number.isFinite(value) ? Math.min(largest, Math.max(least, value)) : usual;
}

/** Copies the address; gives what to say. */
export async function copy() {
  try {
    await navigator.clipboard.writeText(location.href);
    return "The link is copied.";
  } catch {
    return "The link is the address of this page now.";
  }
}
