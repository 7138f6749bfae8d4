// The page's part of Scan.show: collects mouse and keys, asks the kernel for one picture at a time, and shows it.
// Written for anywidget: no build step.  Events between two pictures are added up; after a pause the picture at rest follows.

const REST = 200; // ms without an event until the picture at rest is asked for
const KEYS = "wasdqe";
const ARROWS = { ArrowUp: "w", ArrowDown: "s", ArrowLeft: "a", ArrowRight: "d", PageUp: "e", PageDown: "q" };
const HELP = "Drag: look around. Shift+drag: move across. Wheel or W A S D Q E: move. Shift: faster, Alt: slower. Home: start.";

function render({ model, el }) {
  const image = document.createElement("img");
  const status = document.createElement("div");
  image.tabIndex = 0;
  image.draggable = false;
  image.alt = `${model.get("title")}. ${HELP}`;
  image.title = HELP;
  image.style.cssText = "width:100%;object-fit:contain;background:#000;cursor:grab;touch-action:none;outline-offset:-2px;display:block";
  image.style.height = `${model.get("height")}px`;
  status.setAttribute("role", "status");
  status.style.cssText = "font:12px system-ui,sans-serif;min-height:1.4em;opacity:0.8";
  status.textContent = "Rendering the first picture …";
  el.append(image, status);

  const held = new Set();
  let sum = {}, number = 0, waiting = false, due = false, moving = false, modifiers = {}, last = 0, address = null, rest = 0, gone = false;

  const add = (name, ...values) => {
    sum[name] = (sum[name] || values.map(() => 0)).map((value, axis) => value + values[axis]);
  };
  const size = () => {
    const scale = Math.min(window.devicePixelRatio || 1, 1.5);
    return [Math.round((image.clientWidth || 960) * scale), Math.round(model.get("height") * scale)];
  };
  const ask = (inMotion) => {
    if (gone) return;
    if (waiting) { due = true; moving = inMotion; return; }
    const now = performance.now();
    const event = { number: ++number, moving: inMotion, size: size(), keys: [...held].join(""), ...modifiers };
    if (held.size) event.seconds = last ? (now - last) / 1000 : 0.03;
    for (const [name, values] of Object.entries(sum)) event[name] = values.length === 1 ? values[0] : values;
    last = held.size ? now : 0;
    sum = {};
    waiting = true;
    due = false;
    model.send(event);
    clearTimeout(rest);
    if (inMotion && !held.size) rest = setTimeout(() => ask(false), REST);
  };
  const received = (message, buffers) => {
    if (message.number !== number) return; // another view of the same widget asked
    waiting = false;
    if (message.error) {
      status.textContent = message.error;
    } else {
      const next = URL.createObjectURL(new Blob([buffers[0]], { type: "image/jpeg" }));
      image.src = next;
      if (address) URL.revokeObjectURL(address);
      address = next;
      status.textContent = message.moving ? "" : `${message.size[0]} × ${message.size[1]}`;
      image.dataset.moving = String(Boolean(message.moving));
      image.dataset.number = String(message.number);
    }
    if (held.size || Object.keys(sum).length) ask(true);
    else if (due) ask(moving);
  };
  model.on("msg:custom", received);

  let from = null;
  image.addEventListener("pointerdown", (event) => {
    image.focus();
    image.setPointerCapture(event.pointerId);
    from = [event.clientX, event.clientY];
    image.style.cursor = "grabbing";
    event.preventDefault();
  });
  image.addEventListener("pointermove", (event) => {
    if (!from) return;
    add(event.shiftKey || event.buttons & 4 ? "pan" : "look", event.clientX - from[0], event.clientY - from[1]);
    from = [event.clientX, event.clientY];
    ask(true);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    image.addEventListener(name, () => { from = null; image.style.cursor = "grab"; });
  }
  image.addEventListener("wheel", (event) => {
    const pixels = event.deltaMode === 1 ? event.deltaY * 33 : event.deltaMode === 2 ? event.deltaY * 300 : event.deltaY;
    add("wheel", -pixels / 100);
    event.preventDefault();
    ask(true);
  }, { passive: false });
  image.addEventListener("contextmenu", (event) => event.preventDefault());

  const keyOf = (event) => ARROWS[event.key] || (event.key.length === 1 && KEYS.includes(event.key.toLowerCase()) ? event.key.toLowerCase() : null);
  const note = (event) => { modifiers = { fast: event.shiftKey, slow: event.altKey }; };
  image.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey) return;
    note(event);
    const key = keyOf(event);
    if (key) held.add(key);
    else if (event.key === "Home") sum.home = [true];
    else if (event.key === "+" || event.key === "-") add("faster", event.key === "+" ? 1 : -1);
    else return;
    event.preventDefault();
    event.stopPropagation(); // the notebook has commands on single keys
    ask(true);
  });
  image.addEventListener("keyup", (event) => {
    note(event);
    const key = keyOf(event);
    if (!key) return;
    held.delete(key);
    event.stopPropagation();
    if (!held.size) { clearTimeout(rest); rest = setTimeout(() => ask(false), REST); }
  });
  image.addEventListener("blur", () => { if (held.size) { held.clear(); ask(false); } });

  ask(false);
  return () => {
    gone = true;
    clearTimeout(rest);
    model.off("msg:custom", received);
    if (address) URL.revokeObjectURL(address);
  };
}

export default { render };
