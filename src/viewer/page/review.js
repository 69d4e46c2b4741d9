// Decisions on goldens, sent to who keeps them.

const decided = new Map();

/** The bar that an item is decided in; null where there is nothing to decide. */
function decisionOf(item) {
  if (!data.review || !item.decision) return null;
  const { approve, before, possible } = item.decision;
  const reason = el("input", { id: "reason", type: "text", maxlength: 1000, required: true, placeholder: "why this image is right, or wrong", "aria-label": "Reason", autocomplete: "off" });
  const status = el("output", { id: "decided", role: "status" }, decided.get(item.id) ?? before ?? "");
  const take = (decision) => decide(item, decision, reason, status);
  const form = el(
    "form",
    { class: "decision", "aria-label": "Decision" },
    el("p", {}, possible ? `Approving ${approve}.` : approve),
    reason,
    el("button", { type: "button", id: "approve", title: "Approve (a)", disabled: !possible, click: () => take("approve") }, "Approve"),
    el("button", { type: "button", id: "reject", title: "Reject (r)", disabled: !possible, click: () => take("reject") }, "Reject"),
    status,
  );
  form.addEventListener("submit", (event) => event.preventDefault());
  return form;
}

async function decide(item, decision, reason, status) {
  if (!reason.value.trim()) {
    status.textContent = "Say why first.";
    reason.focus();
    return;
  }
  // Somebody may have gone to another case meanwhile, and come back.
  const say = (text) => { (stage.item === item ? byId("decided") : status).textContent = text; };
  say("…");
  try {
    const answer = await send("decide", { case: item.id, decision, reason: reason.value.trim() });
    const { message, outcome } = await answer.json();
    say(message);
    if (!answer.ok) return;
    decided.set(item.id, message);
    item.outcome = outcome;
    fillChips();
    fillList();
    if (stage.item === item) byId("stage").querySelector("h2 .badge").replaceWith(badge(outcome));
  } catch {
    say("The review has ended: nothing was decided.");
  }
}

/** Ends the review. */
function finishButton() {
  const button = el("button", { type: "button", id: "finish", click: async () => {
    const answer = await send("finish", {}).catch(() => null);
    button.textContent = answer?.ok ? "Review ended" : "Review had ended";
    button.disabled = true;
  } }, "Finish review");
  return button;
}

const send = (what, body) =>
  fetch(what, {
    method: "POST",
    headers: { "content-type": "application/json", "x-aogauge-token": data.review.token },
    body: JSON.stringify(body),
  });

/** A key's decision: begins with the reason where there is none. */
function decideByKey(decision) {
  byId(decision)?.click();
}
